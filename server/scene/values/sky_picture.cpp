#include "server/scene/values/sky_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numbers>
#include <utility>

namespace radiosity::scene {
namespace {

using std::numbers::pi;
/// As for surfaces, of which those shoot that are so many times as bright as the mean.
constexpr double kBright = 8.0;
/// The mean of what is no brighter than that is found in so many steps at most, or once it changes by less than this.
constexpr int kMostSteps = 40;
constexpr double kSettled = 1e-3;
/// A smaller part of all light is not told apart.
constexpr double kLittle = 0.005;
/// Colours are one where none of all texels differs from it by more than this part: a place may see few of them.
constexpr double kSameColour = 0.02;
/// Sums are made of no more columns and rows: half of the cells that rays tell apart are eight columns wide.
constexpr std::size_t kSumWidth = 1024, kSumHeight = 512;

double luminance(const glm::dvec3& colour) { return 0.2126 * colour.x + 0.7152 * colour.y + 0.0722 * colour.z; }

/// Height of the upper edge of a row.
double heightOf(std::size_t row, std::size_t rows) {
  return std::cos(pi * static_cast<double>(row) / static_cast<double>(rows));
}

/// Calls visit(texel number, solid angle) for each texel.
template <typename Visit>
void forEachTexel(const SkyImage& image, const Visit& visit) {
  const double column = 2.0 * pi / static_cast<double>(image.width);
  for (std::size_t y = 0; y < image.height; ++y) {
    const double solid_angle = column * (heightOf(y, image.height) - heightOf(y + 1, image.height));
    for (std::size_t x = 0; x < image.width; ++x) visit(y * image.width + x, solid_angle);
  }
}

SkyImage reduced(const SkyImage& image) {
  if (image.width <= kSumWidth && image.height <= kSumHeight) return image;
  SkyImageMaker maker(image.width, image.height, kSumWidth, kSumHeight);
  for (std::size_t y = 0; y < image.height; ++y)
    maker.addRow(std::span(image.texels).subspan(y * image.width, image.width));
  return maker.take();
}

/// Luminance that little is above: kBright times the mean of what is cut off there.
double brightFrom(const SkyImage& image) {
  std::vector<float> of_texel(image.texels.size());
  for (std::size_t i = 0; i < of_texel.size(); ++i)
    of_texel[i] = static_cast<float>(luminance(glm::dvec3(image.texels[i])));
  double from = HUGE_VAL;
  for (int step = 0; step < kMostSteps; ++step) {
    double sum = 0.0;
    forEachTexel(image, [&](std::size_t i, double solid_angle) {
      sum += solid_angle * std::min(from, static_cast<double>(of_texel[i]));
    });
    const double next = kBright * sum / (4.0 * pi);
    if (!(next < (1.0 - kSettled) * from)) break;
    from = next;
  }
  return from;
}

glm::dvec3 lightOf(const SkyImage& image) {
  glm::dvec3 sum(0.0);
  forEachTexel(image, [&](std::size_t i, double solid_angle) { sum += solid_angle * glm::dvec3(image.texels[i]); });
  return sum;
}

/// In proportion to strength(texel); of this light.
template <typename Strength>
void addLamp(const SkyImage& image, const glm::dvec3& light, const Strength& strength, std::vector<SkyLamp>& lamps) {
  SkyGrid grid{image.width, image.height, std::vector<float>(image.texels.size())};
  for (std::size_t i = 0; i < grid.strength.size(); ++i)
    grid.strength[i] = static_cast<float>(std::max(0.0, strength(glm::dvec3(image.texels[i]))));
  auto table = skyTable(grid);
  if (table.empty()) return;
  const auto key = keyOfFloats(table);
  lamps.push_back({std::make_shared<const std::vector<float>>(std::move(table)), key, light});
}

/// What of the mean colour a texel has in all channels.
double common(const glm::dvec3& texel, const glm::dvec3& mean) {
  double least = HUGE_VAL;
  for (int c = 0; c < 3; ++c)
    if (mean[c] > 0.0) least = std::min(least, texel[c] / mean[c]);
  return std::isfinite(least) ? least : 0.0;
}

/// One of the mean colour; where colours differ it sends what all channels have, and each channel the rest by itself.
std::vector<SkyLamp> lampsOf(const SkyImage& image) {
  std::vector<SkyLamp> lamps;
  const auto light = lightOf(image);
  if (!(luminance(light) > 0.0)) return lamps;
  const auto mean = light / luminance(light);
  double shared = 0.0;
  bool is_one_colour = true;
  forEachTexel(image, [&](std::size_t i, double solid_angle) {
    const glm::dvec3 texel(image.texels[i]);
    const double in_all = common(texel, mean);
    shared += solid_angle * in_all;
    for (int c = 0; c < 3; ++c)
      is_one_colour = is_one_colour && texel[c] - in_all * mean[c] <= kSameColour * luminance(texel);
  });
  if (is_one_colour) {
    addLamp(image, light, luminance, lamps);
    return lamps;
  }
  const double part = shared / luminance(light);
  if (part > kLittle)
    addLamp(
        image, part * light, [&](const glm::dvec3& texel) { return common(texel, mean); }, lamps);
  for (int c = 0; c < 3; ++c) {
    glm::dvec3 rest(0.0);
    rest[c] = (part > kLittle ? 1.0 - part : 1.0) * light[c];
    const auto more = [&](const glm::dvec3& texel) {
      return texel[c] - (part > kLittle ? common(texel, mean) * mean[c] : 0.0);
    };
    if (rest[c] > 0.0) addLamp(image, rest, more, lamps);
  }
  return lamps;
}

}  // namespace

SkyImageMaker::SkyImageMaker(std::size_t columns, std::size_t rows, std::size_t most_width, std::size_t most_height)
    : columns_(columns), rows_(rows) {
  image_.width = std::min(columns, most_width);
  image_.height = std::min(rows, most_height);
  image_.texels.resize(image_.width * image_.height);
  across_.resize(image_.width);
  sums_.assign(image_.width, glm::dvec3(0.0));
}

void SkyImageMaker::addRow(std::span<const glm::vec3> row) {
  const auto width = image_.width;
  if (width == columns_) {
    for (std::size_t x = 0; x < width; ++x) across_[x] = glm::dvec3(row[x]);
  } else {
    std::ranges::fill(across_, glm::dvec3(0.0));
    const double step = static_cast<double>(width) / static_cast<double>(columns_);
    for (std::size_t x = 0; x < columns_; ++x) {  // on one column of the image, or two
      const double from = static_cast<double>(x) * step, to = from + step;
      const auto first = std::min(width - 1, static_cast<std::size_t>(from));
      const double in_first = std::min(to, static_cast<double>(first + 1)) - from;
      across_[first] += in_first * glm::dvec3(row[x]);
      if (first + 1 < width) across_[first + 1] += std::max(0.0, step - in_first) * glm::dvec3(row[x]);
    }
  }
  // Of heights, so that what a row shines with counts by its solid angle.
  double from = heightOf(next_, rows_);
  const double low = heightOf(++next_, rows_);
  while (made_ < image_.height) {
    const double top = heightOf(made_, image_.height), end = heightOf(made_ + 1, image_.height);
    const double part = (from - std::max(low, end)) / (top - end);
    for (std::size_t x = 0; x < width; ++x) sums_[x] += part * across_[x];
    if (end < low) return;  // rows to come have a share in it
    for (std::size_t x = 0; x < width; ++x) {
      image_.texels[made_ * width + x] = glm::vec3(sums_[x]);
      sums_[x] = glm::dvec3(0.0);
    }
    ++made_;
    from = end;
  }
}

SkyImage SkyImageMaker::take() { return std::move(image_); }

SkyPicture::SkyPicture(SkyImage image) : image_(std::move(image)) {
  key_ = keyOfFloats({&image_.texels.front().x, 3 * image_.texels.size()}) ^ (image_.width << 32U);
  forEachTexel(image_, [&](std::size_t i, double) {
    if (image_.texels[i] == glm::vec3(0.0F)) return;
    const auto row = i / image_.width;
    if (2 * row < image_.height) shines_[0] = true;
    if (2 * (row + 1) > image_.height) shines_[1] = true;
  });
  const double from = brightFrom(image_);
  auto rest = image_, bright = image_;
  for (std::size_t i = 0; i < image_.texels.size(); ++i) {
    const double of_texel = luminance(glm::dvec3(image_.texels[i]));
    const auto part = of_texel > from ? static_cast<float>(from / of_texel) : 1.0F;
    rest.texels[i] *= part;
    bright.texels[i] *= 1.0F - part;
  }
  if (luminance(lightOf(bright)) > kLittle * luminance(lightOf(image_))) {
    bright_ = lampsOf(bright);
    sumUp(reduced(rest));
  } else {
    sumUp(reduced(image_));
  }
  whole_ = lampsOf(reduced(image_));
}

void SkyPicture::sumUp(const SkyImage& rest) {
  width_ = rest.width;
  height_ = rest.height;
  sums_.assign((width_ + 1) * (height_ + 1), glm::dvec3(0.0));
  glm::dvec3 row(0.0);
  forEachTexel(rest, [&](std::size_t i, double solid_angle) {
    const auto x = i % width_, y = i / width_;
    if (x == 0) row = glm::dvec3(0.0);
    row += solid_angle * glm::dvec3(rest.texels[i]);
    sums_[(y + 1) * (width_ + 1) + x + 1] = sums_[y * (width_ + 1) + x + 1] + row;
  });
}

/// Integral over all that is above the height, from the first column up to there.
glm::dvec3 SkyPicture::sumAt(double column, double height) const {
  const double row = std::acos(std::clamp(height, -1.0, 1.0)) / pi * static_cast<double>(height_);
  const auto x = std::min(width_ - 1, static_cast<std::size_t>(column));
  const auto y = std::min(height_ - 1, static_cast<std::size_t>(row));
  const double top = heightOf(y, height_), bottom = heightOf(y + 1, height_);
  const double across = column - static_cast<double>(x), down = std::clamp((top - height) / (top - bottom), 0.0, 1.0);
  const auto* at = &sums_[y * (width_ + 1) + x];
  return glm::mix(glm::mix(at[0], at[1], across), glm::mix(at[width_ + 1], at[width_ + 2], across), down);
}

glm::dvec3 SkyPicture::restOver(double azimuth, double width, double height, double extent) const {
  const auto columns = static_cast<double>(width_);
  const double first = (azimuth / (2.0 * pi) + 0.5) * columns, count = width / (2.0 * pi) * columns;
  const double turned = first - std::floor(first / columns) * columns;  // in [0, columns)
  const auto upTo = [&](double column) {                                // over all turns
    const double turns = std::floor(column / columns);
    const auto whole = turns > 0.0 ? turns * (sumAt(columns, height) - sumAt(columns, height + extent)) : glm::dvec3(0);
    const double left = column - turns * columns;
    return whole + sumAt(left, height) - sumAt(left, height + extent);
  };
  return glm::max(upTo(turned + count) - upTo(turned), 0.0) / (width * extent);
}

glm::vec3 SkyPicture::radiance(const glm::dvec3& direction) const {
  const auto width = static_cast<double>(image_.width), height = static_cast<double>(image_.height);
  const double column = (std::atan2(direction.z, direction.x) / (2.0 * pi) + 0.5) * width - 0.5;
  const double row = std::clamp(std::acos(std::clamp(direction.y, -1.0, 1.0)) / pi * height - 0.5, 0.0, height - 1.0);
  const double left = std::floor(column), top = std::floor(row);
  const auto texel = [&](double x, double y) {
    const auto at = static_cast<std::size_t>(std::fmod(x + width, width));
    return image_.texels[std::min(image_.height - 1, static_cast<std::size_t>(y)) * image_.width + at];
  };
  const auto across = static_cast<float>(column - left), down = static_cast<float>(row - top);
  return glm::mix(glm::mix(texel(left, top), texel(left + 1.0, top), across),
                  glm::mix(texel(left, top + 1.0), texel(left + 1.0, top + 1.0), across), down);
}

std::size_t SkyPicture::bytes() const {
  std::size_t bytes = image_.texels.size() * sizeof(glm::vec3) + sums_.size() * sizeof(glm::dvec3);
  for (const auto* lamps : {&bright_, &whole_})
    for (const auto& lamp : *lamps) bytes += lamp.table->size() * sizeof(float);
  return bytes;
}

}  // namespace radiosity::scene
