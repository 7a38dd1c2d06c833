#include "tests/accuracy/lit_scene.h"

#include <ImfArray.h>
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <glm/common.hpp>
#include <map>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>

namespace radiosity::accuracy {
namespace {

/// A corner of a clipped triangle: where on the page (texels), where in the world, and its shading normal.
struct Corner {
  glm::dvec2 texel;
  glm::dvec3 world, shading;
};
using Polygon = std::vector<Corner>;

/// Keeps the part where sign * texel[axis] >= sign * limit.
Polygon clip(const Polygon& polygon, int axis, double limit, double sign) {
  Polygon kept;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const auto& a = polygon[i];
    const auto& b = polygon[(i + 1) % polygon.size()];
    const double da = sign * (a.texel[axis] - limit);
    const double db = sign * (b.texel[axis] - limit);
    if (da >= 0.0) kept.push_back(a);
    if ((da > 0.0 && db < 0.0) || (da < 0.0 && db > 0.0)) {
      const double t = da / (da - db);
      kept.push_back({glm::mix(a.texel, b.texel, t), glm::mix(a.world, b.world, t), glm::mix(a.shading, b.shading, t)});
    }
  }
  return kept;
}

double texelArea(const Polygon& polygon) {
  double twice = 0.0;
  for (std::size_t i = 1; i + 1 < polygon.size(); ++i) {
    const auto u = polygon[i].texel - polygon[0].texel;
    const auto v = polygon[i + 1].texel - polygon[0].texel;
    twice += u.x * v.y - u.y * v.x;
  }
  return 0.5 * std::abs(twice);
}

/// One side of a triangle of the lit file.
struct Side {
  const oracle::Triangle& triangle;
  std::uint32_t traced;  ///< its place in the scene that light is traced in
  bool back;
};

void addPieces(Texel& texel, const Polygon& polygon, const Side& side) {
  texel.coverage += texelArea(polygon);
  const auto& rho = side.triangle.reflectance;
  texel.least_reflectance = std::min({texel.least_reflectance, rho.x, rho.y, rho.z});
  texel.node = side.triangle.node;
  texel.two_sided = texel.two_sided || side.triangle.double_sided;
  const double sign = side.back ? -1.0 : 1.0;
  for (std::size_t i = 1; i + 1 < polygon.size(); ++i) {
    texel.footprint.pieces.push_back(
        {{polygon[0].world, polygon[i].world, polygon[i + 1].world},
         sign * side.triangle.normal,
         side.traced,
         {sign * polygon[0].shading, sign * polygon[i].shading, sign * polygon[i + 1].shading}});
  }
}

using TexelMap = std::map<std::tuple<int, int, int, bool>, Texel>;  // page, y, x, back

void rasterize(const Side& side, const Page& page, TexelMap& texels) {
  const auto& triangle = side.triangle;
  Polygon whole;
  glm::dvec2 low(1e300);
  glm::dvec2 high(-1e300);
  for (std::size_t k = 0; k < 3; ++k) {
    whole.push_back(
        {triangle.lightmap_uv[k] * glm::dvec2(page.width, page.height), triangle.corners[k], triangle.shading[k]});
    low = glm::min(low, whole.back().texel);
    high = glm::max(high, whole.back().texel);
  }
  for (int y = static_cast<int>(std::floor(low.y)); y < high.y; ++y) {
    const auto row = clip(clip(whole, 1, y, 1.0), 1, y + 1, -1.0);
    for (int x = static_cast<int>(std::floor(low.x)); x < high.x; ++x) {
      const auto cell = clip(clip(row, 0, x, 1.0), 0, x + 1, -1.0);
      if (cell.size() < 3 || texelArea(cell) < 1e-9) continue;
      auto& texel = texels[{triangle.lightmap_page, y, x, side.back}];
      texel.page = triangle.lightmap_page;
      texel.x = x;
      texel.y = y;
      texel.back = side.back;
      addPieces(texel, cell, side);
    }
  }
}

}  // namespace

glm::dvec3 Page::at(int x, int y) const {
  const auto column = static_cast<std::size_t>(std::clamp(x, 0, width - 1));
  const auto row = static_cast<std::size_t>(std::clamp(y, 0, height - 1));
  return pixels[row * static_cast<std::size_t>(width) + column];
}

glm::dvec3 Page::bilinear(const glm::dvec2& uv) const {
  const auto p = uv * glm::dvec2(width, height) - 0.5;
  const auto corner = glm::floor(p);
  const auto t = p - corner;
  const int x = static_cast<int>(corner.x);
  const int y = static_cast<int>(corner.y);
  return glm::mix(glm::mix(at(x, y), at(x + 1, y), t.x), glm::mix(at(x, y + 1), at(x + 1, y + 1), t.x), t.y);
}

Page readExr(const std::filesystem::path& file) {
  Imf::InputFile in(file.c_str());
  const auto window = in.header().dataWindow();
  Page page{window.max.x - window.min.x + 1, window.max.y - window.min.y + 1, {}};
  page.pixels.resize(static_cast<std::size_t>(page.width) * static_cast<std::size_t>(page.height));
  Imf::FrameBuffer frame;
  constexpr std::array<const char*, 3> kChannels{"R", "G", "B"};
  for (std::size_t c = 0; c < 3; ++c) {
    const auto* channel = in.header().channels().findChannel(kChannels[c]);
    if (channel == nullptr) throw std::runtime_error(file.string() + ": no channel " + kChannels[c]);
    if (channel->type != Imf::FLOAT) throw std::runtime_error(file.string() + ": channels are not 32-bit float");
    auto* base = reinterpret_cast<char*>(page.pixels.data()) + c * sizeof(float);
    base -= (static_cast<std::ptrdiff_t>(window.min.y) * page.width + window.min.x) *
            static_cast<std::ptrdiff_t>(sizeof(glm::vec3));
    frame.insert(kChannels[c], Imf::Slice(Imf::FLOAT, base, sizeof(glm::vec3),
                                          sizeof(glm::vec3) * static_cast<std::size_t>(page.width)));
  }
  in.setFrameBuffer(frame);
  in.readPixels(window.min.y, window.max.y);
  return page;
}

void writeExr(const Page& page, const std::filesystem::path& file) {
  Imf::Header header(page.width, page.height);
  Imf::FrameBuffer frame;
  constexpr std::array<const char*, 3> kChannels{"R", "G", "B"};
  for (std::size_t c = 0; c < 3; ++c) {
    header.channels().insert(kChannels[c], Imf::Channel(Imf::FLOAT));
    auto* base = const_cast<char*>(reinterpret_cast<const char*>(page.pixels.data())) + c * sizeof(float);
    frame.insert(kChannels[c], Imf::Slice(Imf::FLOAT, base, sizeof(glm::vec3),
                                          sizeof(glm::vec3) * static_cast<std::size_t>(page.width)));
  }
  Imf::OutputFile out(file.c_str(), header);
  out.setFrameBuffer(frame);
  out.writePixels(page.height);
}

Page readPfm(const std::filesystem::path& file) {
  constexpr int kMaxSide = 1 << 16;
  std::ifstream in(file, std::ios::binary);
  std::string magic;
  Page page;
  double scale = 0.0;
  in >> magic >> page.width >> page.height >> scale;
  in.get();  // the one blank before the pixels
  if (!in || magic != "PF" || page.width < 1 || page.width > kMaxSide || page.height < 1 || page.height > kMaxSide ||
      !(scale < 0.0)) {
    throw std::runtime_error(file.string() + ": not a little-endian colour PFM");
  }
  const auto width = static_cast<std::size_t>(page.width);
  page.pixels.resize(width * static_cast<std::size_t>(page.height));
  for (auto row = static_cast<std::size_t>(page.height); row-- > 0;) {
    in.read(reinterpret_cast<char*>(page.pixels.data() + row * width),
            static_cast<std::streamsize>(width * sizeof(glm::vec3)));
  }
  if (!in) throw std::runtime_error(file.string() + ": fewer pixels than its header says");
  return page;
}

namespace {

LitScene withPages(oracle::TriangleScene scene, const std::filesystem::path& glb) {
  LitScene lit{std::move(scene), {}};
  int last = -1;
  for (const auto& triangle : lit.scene.triangles) last = std::max(last, triangle.lightmap_page);
  if (last < 0) throw std::runtime_error(glb.string() + ": no primitive names a lightmap page in its extras");
  for (int page = 0; page <= last; ++page) {
    const auto name = glb.stem().string() + ".lightmap." + std::to_string(page) + ".exr";
    lit.pages.push_back(readExr(glb.parent_path() / name));
  }
  return lit;
}

}  // namespace

LitScene readLitScene(const std::filesystem::path& glb) {
  auto lit = withPages(oracle::readGlb(glb), glb);
  auto joined = oracle::joinSides(lit.scene);
  if (joined.triangles.size() < lit.scene.triangles.size()) lit.unlit = std::move(joined);
  return lit;
}

LitScene readLitScene(const std::filesystem::path& glb, const std::filesystem::path& unlit) {
  auto lit = withPages(oracle::readGlb(glb), glb);
  lit.unlit = oracle::joinSides(oracle::readGlb(unlit));
  return lit;
}

std::vector<Texel> findTexels(const LitScene& lit) {
  TexelMap texels;
  const auto matches = lit.unlit ? oracle::matchTriangles(lit.scene, *lit.unlit) : std::vector<std::uint32_t>();
  for (std::uint32_t i = 0; i < lit.scene.triangles.size(); ++i) {
    const auto& triangle = lit.scene.triangles[i];
    if (triangle.lightmap_page < 0) continue;
    const auto& page = lit.pages.at(static_cast<std::size_t>(triangle.lightmap_page));
    const auto traced = lit.unlit ? matches[i] : i;
    rasterize({triangle, traced, false}, page, texels);
    if (triangle.double_sided) rasterize({triangle, traced, true}, page, texels);
  }
  std::vector<Texel> result;
  result.reserve(texels.size());
  for (auto& [key, texel] : texels) result.push_back(std::move(texel));
  return result;
}

bool sameLayout(const LitScene& a, const LitScene& b) {
  const auto same_page = [](const Page& p, const Page& q) { return p.width == q.width && p.height == q.height; };
  const auto same_triangle = [](const oracle::Triangle& s, const oracle::Triangle& t) {
    return s.corners == t.corners && s.lightmap_uv == t.lightmap_uv && s.lightmap_page == t.lightmap_page &&
           s.double_sided == t.double_sided;
  };
  return std::equal(a.pages.begin(), a.pages.end(), b.pages.begin(), b.pages.end(), same_page) &&
         std::equal(a.scene.triangles.begin(), a.scene.triangles.end(), b.scene.triangles.begin(),
                    b.scene.triangles.end(), same_triangle);
}

}  // namespace radiosity::accuracy
