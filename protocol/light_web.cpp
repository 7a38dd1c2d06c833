#include "protocol/light_web.h"

#include <nlohmann/json.hpp>

#include "protocol/json_text.h"

namespace radiosity::protocol {

std::string encodeHttpWeb(const Web& web) {
  return dumpJson({{"revision", web.revision},
                   {"lumens", web.lumens},
                   {"candelaMost", web.most_candela},
                   {"axis", web.axis},
                   {"across", web.across},
                   {"polar", web.polar},
                   {"azimuth", web.azimuth},
                   {"candela", web.candela}});
}

}  // namespace radiosity::protocol
