// What Gmres says of the error of its solution, beside the error itself: equations of rooms that exchange light.
#include "server/solver/math/gmres.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace radiosity::solver {
namespace {

/// x = rho F x + g, F a matrix of form factors: rows sum to one.
struct Equation {
  std::vector<std::vector<double>> exchange;  ///< rho F
  std::vector<double> shining, weight;
};

/// `rooms` of `size` leaves each, of which all see each other alike but for chance, and so much of what the next room
/// has.
Equation makeRooms(std::size_t rooms, std::size_t size, double rho, double door, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> chance(0.2, 1.0);
  const std::size_t count = rooms * size;
  Equation equation{std::vector<std::vector<double>>(count, std::vector<double>(count, 0.0)),
                    std::vector<double>(count, 0.0), std::vector<double>(count, 0.0)};
  for (std::size_t i = 0; i < count; ++i) {
    double sum = 0.0;
    for (std::size_t j = 0; j < count; ++j) {
      const auto apart = i / size > j / size ? i / size - j / size : j / size - i / size;
      if (apart <= 1) sum += equation.exchange[i][j] = chance(random) * (apart == 0 ? 1.0 : door);
    }
    for (auto& factor : equation.exchange[i]) factor *= rho / sum;
    equation.weight[i] = chance(random);
    if (i < size) equation.shining[i] = chance(random);  // the first room has the lamps
  }
  return equation;
}

void sweepOnce(const Equation& equation, Gmres<double>::Vectors& x, bool affine) {
  for (auto& channel : x) {
    auto next = affine ? equation.shining : std::vector<double>(channel.size(), 0.0);
    for (std::size_t i = 0; i < next.size(); ++i) {
      for (std::size_t j = 0; j < next.size(); ++j) next[i] += equation.exchange[i][j] * channel[j];
    }
    channel = std::move(next);
  }
}

Gmres<double> solve(const Equation& equation, double tolerance) {
  Gmres<double> gmres;
  Gmres<double>::Vectors nothing;
  for (auto& channel : nothing) channel.assign(equation.weight.size(), 0.0);
  gmres.begin(nothing, equation.weight, {tolerance, tolerance, tolerance}, 2000);
  while (!gmres.advance([&](Gmres<double>::Vectors& x, bool affine) { sweepOnce(equation, x, affine); })) continue;
  return gmres;
}

double distance(const Equation& equation, const std::vector<double>& a, const std::vector<double>& b) {
  double square = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) square += equation.weight[i] * (a[i] - b[i]) * (a[i] - b[i]);
  return std::sqrt(square);
}

/// The same but for what all of `a` are above `b` alike.
double distanceOfShape(const Equation& equation, std::vector<double> a, const std::vector<double>& b) {
  double level = 0.0, sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    level += equation.weight[i] * (a[i] - b[i]);
    sum += equation.weight[i];
  }
  for (auto& value : a) value -= level / sum;
  return distance(equation, a, b);
}

struct Told {
  std::vector<double> of_error, of_shape, of_bound;  ///< of the real error, of that but for its level, of the bound
};

/// By room, ascending.
Told toldOfErrors(std::size_t rooms, double rho, double door) {
  Told told;
  for (std::uint32_t seed = 1; seed <= 20; ++seed) {
    const auto equation = makeRooms(rooms, 24, rho, door, seed);
    const double shining = distance(equation, equation.shining, std::vector<double>(equation.weight.size(), 0.0));
    const auto exact = solve(equation, 1e-13 * shining).solution()[0];
    for (const double tolerance : {1e-1, 1e-2, 1e-3, 1e-4, 1e-5}) {
      const auto gmres = solve(equation, tolerance * shining);
      EXPECT_EQ(gmres.error()[0], gmres.error()[2]);
      told.of_error.push_back(gmres.error()[0] / distance(equation, gmres.solution()[0], exact));
      told.of_shape.push_back(gmres.errorOfShape()[0] / distanceOfShape(equation, gmres.solution()[0], exact));
      told.of_bound.push_back(gmres.error()[0] * (1.0 - rho) / gmres.residual()[0]);
    }
  }
  for (auto* ratios : {&told.of_error, &told.of_shape, &told.of_bound}) std::ranges::sort(*ratios);
  return told;
}

TEST(Gmres, TellsTheErrorOfItsSolution) {
  struct Case {
    std::uint32_t rooms;
    double rho, door;
    double least, usual;   ///< told of the error: of all, and of four in five
    double shape;          ///< told of its shape: of four in five
    double most_of_bound;  ///< told of what the residual alone would have it be, in the middle
  };
  // Where the level of light is found last, as between two bright rooms, an error is told several times too small now
  // and then. That of the level is most of what the residual alone would have it be: where it is found first, far less
  // is told. What one room has of light more than the next is its shape, and is taken by sweeps no faster than a level.
  for (const auto& [rooms, rho, door, least, usual, shape, most_of_bound] :
       {Case{1, 0.5, 0.0, 1.0, 1.0, 1.5, 2.0}, Case{1, 0.99, 0.0, 0.25, 0.9, 4.0, 0.3},
        Case{2, 0.9, 0.05, 1.0, 1.0, 0.4, 0.5}, Case{2, 0.99, 0.001, 0.04, 0.6, 0.1, 0.4},
        Case{5, 0.95, 0.02, 0.9, 1.0, 0.3, 2.0}}) {
    SCOPED_TRACE(fmt::format("{} rooms of reflectance {}", rooms, rho));
    const auto told = toldOfErrors(rooms, rho, door);
    EXPECT_GT(told.of_error.front(), least);
    EXPECT_GT(told.of_error[20], usual);
    // A sweep after the last step takes most of what is no level; where nothing else is left that is nearly all.
    EXPECT_LT(told.of_error[50], 40.0);
    EXPECT_LT(told.of_bound[50], most_of_bound);
    EXPECT_GT(told.of_shape[20], shape);
    EXPECT_LT(told.of_shape[50], 20.0);
  }
}

TEST(Gmres, StepsFromAStartThatIsGoodEnoughWhereItIsToTellItsError) {
  const auto equation = makeRooms(1, 24, 0.5, 0.0, 3);
  const double shining = distance(equation, equation.shining, std::vector<double>(equation.weight.size(), 0.0));
  const auto exact = solve(equation, 1e-13 * shining).solution();
  const auto solveFrom = [&](Gmres<double>::Vectors start, double tolerance, bool always_steps) {
    Gmres<double> gmres;
    gmres.begin(std::move(start), equation.weight, {tolerance, tolerance, tolerance}, 2000, always_steps);
    while (!gmres.advance([&](Gmres<double>::Vectors& x, bool affine) { sweepOnce(equation, x, affine); })) continue;
    return gmres;
  };
  auto near = exact;
  for (auto& channel : near) channel[5] *= 1.0001;
  const auto at_once = solveFrom(near, 1e-2 * shining, false), told = solveFrom(near, 1e-2 * shining, true);
  EXPECT_EQ(at_once.sweeps(), 1);
  EXPECT_TRUE(std::isinf(at_once.error()[0]));
  EXPECT_EQ(told.sweeps(), 3) << "of the start, of its residual, and of what that brings";
  EXPECT_GE(told.error()[0], distance(equation, told.solution()[0], exact[0]));
  EXPECT_LT(told.error()[0], 1e-4 * shining);
  EXPECT_EQ(solveFrom(exact, 1e-2 * shining, true).sweeps(), 1) << "nothing is left to step by";
}

TEST(Gmres, TellsNothingOfAnErrorWhereNoStepWasTaken) {
  const auto equation = makeRooms(1, 8, 0.5, 0.0, 1);
  EXPECT_TRUE(std::isinf(solve(equation, 1e9).error()[0]));
  EXPECT_TRUE(std::isinf(solve(equation, 1e9).errorOfShape()[0]));
  auto dark = equation;
  std::ranges::fill(dark.shining, 0.0);
  EXPECT_EQ(solve(dark, 0.0).error()[0], 0.0);
  EXPECT_EQ(solve(dark, 0.0).errorOfShape()[0], 0.0);
}

}  // namespace
}  // namespace radiosity::solver
