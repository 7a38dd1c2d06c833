// One scene's rows of error against time: fresh runs of `radiosity solve`, each as a user starts it, judged by the path
// tracer; and bakes of the same texels by Cycles, judged alike. Runs other programs and waits for them; one thread.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tests/accuracy/compare.h"
#include "tests/accuracy/reference_store.h"

namespace radiosity::benchmark {

struct SeriesOptions {
  std::vector<double> times{0.1, 0.2, 0.5, 1, 2, 5, 10, 30};  ///< limits of solve time in seconds, rising
  double goal = 0.02;                                         ///< stated error that one more run asks for
  double floor = 0.002;                                       ///< stated error at which longer runs add nothing
  std::string client = "radiosity";
  std::vector<std::string> solve_arguments;
  bool chosen_texels = false;  ///< by the program, as many as the error asks for; else of one size
  std::string sky = "1000";    ///< of scenes in which nothing shines, as `radiosity solve --sky` takes it
  accuracy::ReferenceOptions reference;
  std::filesystem::path reference_folder, work_folder;

  bool cycles = true;
  std::string blender = "blender";
  std::filesystem::path bake_script;
  double cycles_seconds = 45.0;  ///< of the longest bake, about
  std::string cycles_samples;    ///< of each bake, by commas, however long they take; empty: what the time allows
};

struct StatedError {
  double total = 0.0, residual = 0.0, sampling = 0.0, variation = 0.0, discretization = 0.0;
};

struct SolveRow {
  double asked_seconds = 0.0;
  int exit_code = 0;
  double seconds = 0.0;       ///< of solving, as the report says
  double wall_seconds = 0.0;  ///< of the whole command: start-up, solve, files written
  std::uint64_t shots = 0;
  bool measured = false;  ///< the rest holds
  StatedError stated;
  accuracy::SurfaceError surface;             ///< what people see
  oracle::ErrorMetrics solver, total, plain;  ///< plain: solver error of the texels that Cycles can be judged on

  /// The truth is known: not lost in the reference's own noise.
  [[nodiscard]] bool resolved() const { return measured && solver.solverRms() > kResolved * solver.reference_noise; }
  /// An error this part of the noise makes a ninth of what is measured, so that subtracting leaves something to trust.
  static constexpr double kResolved = 1.0 / 3.0;
};

struct CyclesRow {
  int samples = 0;
  double seconds = 0.0;  ///< of one bake, set-up included
  oracle::ErrorMetrics plain;
};

struct CyclesSeries {
  std::string version;
  std::string missing;         ///< why there are no rows; empty: there are
  double start_seconds = 0.0;  ///< of the program and the scene's construction: what no bake is charged for
  std::vector<CyclesRow> rows;
};

struct SceneSeries {
  std::string name;
  std::string sky;         ///< that it was lit by, since nothing in it shines; empty: none
  std::string unmeasured;  ///< why there is no truth; empty: there is
  std::uint64_t patches = 0, polygons = 0;
  std::string renderer;
  std::size_t reference_texels = 0, plain_texels = 0, reference_points = 0;
  double texel_noise = 0.0, point_noise = 0.0, reference_seconds = 0.0;
  double cut = 0.0, hidden = 0.0;  ///< parts of the texels' area without solver error (accuracy::Reference)
  std::string reference_note;      ///< what the reference could not be made of
  double undecided = 0.0;  ///< part of the texels' area, left out: models are open there (accuracy::undecidedArea)
  bool reference_from_disk = false, reference_exact = false;
  std::vector<SolveRow> rows;
  std::optional<SolveRow> asked;  ///< one that was asked for a stated error of `goal`: what a user gets for it
  std::optional<CyclesSeries> cycles;
};

/// Prints a line a run to stderr. A scene that cannot be solved or judged says why in `unmeasured`.
[[nodiscard]] SceneSeries measureScene(const std::filesystem::path& scene, const SeriesOptions& options);

/// Bakes `glb`, whose pages `lit` has, and compares with its reference.
[[nodiscard]] CyclesSeries bakeWithCycles(const std::filesystem::path& glb, const accuracy::LitScene& lit,
                                          const accuracy::Reference& reference, const SeriesOptions& options);

}  // namespace radiosity::benchmark
