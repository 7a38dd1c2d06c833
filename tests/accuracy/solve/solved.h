// What a test of the whole program has of a solve.
#pragma once

#include <nlohmann/json.hpp>

#include "tests/accuracy/lit_scene.h"

namespace radiosity::accuracy {

struct Solved {
  LitScene lit;
  nlohmann::json report;
};

}  // namespace radiosity::accuracy
