#include "server/geometry/normal_matrix.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <utility>

namespace radiosity::scene {

glm::dmat3 normalMatrix(const glm::dmat4& m) {
  const glm::dvec3 x(m[0]), y(m[1]), z(m[2]);
  const double sign = glm::dot(x, glm::cross(y, z)) < 0.0 ? -1.0 : 1.0;
  const glm::dmat3 cofactors = sign * glm::dmat3(glm::cross(y, z), glm::cross(z, x), glm::cross(x, y));
  double largest = 0.0;
  for (int column = 0; column < 3; ++column)
    for (int row = 0; row < 3; ++row) largest = std::max(largest, std::abs(cofactors[column][row]));
  return largest > 0.0 ? cofactors / largest : cofactors;
}

}  // namespace radiosity::scene
