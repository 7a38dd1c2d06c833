// /metrics in the text format of Prometheus 0.0.4: prefix radiosityd_, base units, _total for what only grows.
#pragma once

#include <string>

#include "server/net/hub.h"

namespace radiosity::net {

[[nodiscard]] std::string metricsText(Hub& hub);

}  // namespace radiosity::net
