#include "protocol/light_web.h"

#include <nlohmann/json.hpp>

#include "protocol/json_text.h"

namespace radiosity::protocol {
namespace {

nlohmann::json listOf(const std::vector<float>& values) {
  auto list = nlohmann::json::array();
  for (const float value : values) list.push_back(sixDigits(static_cast<double>(value)));
  return list;
}

}  // namespace

std::string encodeHttpWeb(const Web& web) {
  return dumpJson({{"revision", web.revision},
                   {"lumens", sixDigits(web.lumens)},
                   {"candelaMost", sixDigits(web.most_candela)},
                   {"axis", web.axis},
                   {"across", web.across},
                   {"polar", listOf(web.polar)},
                   {"azimuth", listOf(web.azimuth)},
                   {"candela", listOf(web.candela)}});
}

}  // namespace radiosity::protocol
