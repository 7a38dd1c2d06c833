// Reads inputs and results of View3D, the view factor program of NIST (Walton 2002, NISTIR 6925): geometries with
// obstructions, subsurfaces and combined surfaces, computed by others.
#pragma once

#include <filesystem>
#include <vector>

#include "tests/oracle/form_factors.h"

namespace radiosity::oracle {

struct View3dSurface {
  Corners corners;  ///< counter-clockwise seen from the front
  int base = -1;    ///< lies on that surface and is not part of its area
  int combined_with = -1;
};

/// `F 3` input files (vertices and surfaces by vertex number). Throws std::runtime_error for others.
[[nodiscard]] std::vector<View3dSurface> readView3dInput(const std::filesystem::path& file);

struct ViewFactors {
  std::vector<double> areas;
  std::vector<double> factors;  ///< row-major
};

[[nodiscard]] ViewFactors readView3dOutput(const std::filesystem::path& file);

/// View factors of the surfaces with subsurfaces cut out and combined surfaces merged, in View3D's order.
[[nodiscard]] ViewFactors viewFactors(const std::vector<View3dSurface>& surfaces, const IntegrationOptions& options);

}  // namespace radiosity::oracle
