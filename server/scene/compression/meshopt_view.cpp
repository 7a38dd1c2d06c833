#include "server/scene/compression/meshopt_view.h"

#include <meshoptimizer.h>

#include <array>
#include <string_view>

namespace radiosity::scene {
namespace {

constexpr std::string_view kAttributes = "ATTRIBUTES", kTriangles = "TRIANGLES", kIndices = "INDICES";
constexpr std::size_t kMostStride = 256;

/// A codec's streams begin with its number in the upper half of a byte, and its version in the lower.
struct Codec {
  std::string_view mode;
  std::uint8_t number, newest;
};
constexpr std::array kCodecs = {Codec{kAttributes, 0xA0, 0}, Codec{kTriangles, 0xE0, 1}, Codec{kIndices, 0xD0, 1}};

struct Filter {
  std::string_view name;
  void (*decode)(void* elements, std::size_t count, std::size_t stride);
  bool (*allows)(std::size_t stride);
};
constexpr std::array kFilters = {
    Filter{"NONE", nullptr, [](std::size_t) { return true; }},
    Filter{"OCTAHEDRAL", meshopt_decodeFilterOct, [](std::size_t stride) { return stride == 4 || stride == 8; }},
    Filter{"QUATERNION", meshopt_decodeFilterQuat, [](std::size_t stride) { return stride == 8; }},
    Filter{
        "EXPONENTIAL",
        [](void* elements, std::size_t count, std::size_t stride) { meshopt_decodeFilterExp(elements, count, stride); },
        [](std::size_t stride) { return stride % 4 == 0; }}};

template <typename Row>
const Row* find(const auto& rows, std::string_view name, std::string_view Row::*member) {
  for (const auto& row : rows)
    if (row.*member == name) return &row;
  return nullptr;
}

/// 0 where it could be decoded.
int decodeInto(Bytes& out, std::span<const std::uint8_t> stream, const MeshoptView& view) {
  if (view.mode == kAttributes)
    return meshopt_decodeVertexBuffer(out.data(), view.count, view.stride, stream.data(), stream.size());
  if (view.mode == kTriangles)
    return meshopt_decodeIndexBuffer(out.data(), view.count, view.stride, stream.data(), stream.size());
  return meshopt_decodeIndexSequence(out.data(), view.count, view.stride, stream.data(), stream.size());
}

}  // namespace

Result<void> checkMeshopt(const MeshoptView& view, const std::string& where) {
  const auto bad = [&](const char* member, std::string what, ErrorCode code = ErrorCode::kInvalidScene) {
    return fail(code, std::move(what), where + member);
  };
  if (find(kCodecs, view.mode, &Codec::mode) == nullptr)
    return bad("/mode", "'" + view.mode + "' is not known; only ATTRIBUTES, TRIANGLES and INDICES are read",
               ErrorCode::kUnsupported);
  const auto* filter = find(kFilters, view.filter, &Filter::name);
  if (filter == nullptr)
    return bad("/filter", "'" + view.filter + "' is not known; only OCTAHEDRAL, QUATERNION and EXPONENTIAL are read",
               ErrorCode::kUnsupported);
  if (view.mode == kAttributes) {
    if (view.stride == 0 || view.stride % 4 != 0 || view.stride > kMostStride)
      return bad("/byteStride", "must be a multiple of 4, of at most 256");
    if (!filter->allows(view.stride)) return bad("/byteStride", "is not one that " + view.filter + " allows");
    return {};
  }
  if (view.stride != 2 && view.stride != 4) return bad("/byteStride", "of indices must be 2 or 4");
  if (view.mode == kTriangles && view.count % 3 != 0) return bad("/count", "of triangles must be a multiple of 3");
  if (filter->decode != nullptr) return bad("/filter", "is only for ATTRIBUTES");
  return {};
}

Result<Bytes> decodeMeshopt(std::span<const std::uint8_t> stream, const MeshoptView& view, const std::string& where) {
  const auto& codec = *find(kCodecs, view.mode, &Codec::mode);
  if (stream.empty() || (stream[0] & 0xF0U) != codec.number)
    return fail(ErrorCode::kBadInput, "is no stream of the mode " + view.mode, where);
  if ((stream[0] & 0x0FU) > codec.newest) {
    return fail(ErrorCode::kUnsupported,
                "is coded by version " + std::to_string(stream[0] & 0x0FU) + " of the codec for " + view.mode +
                    "; only " + "versions up to " + std::to_string(codec.newest) +
                    " are read (gltfpack -c writes them)",
                where);
  }
  Bytes out(view.bytes());
  if (decodeInto(out, stream, view) != 0) return fail(ErrorCode::kBadInput, "the stream cannot be decoded", where);
  if (const auto* filter = find(kFilters, view.filter, &Filter::name); filter->decode != nullptr)
    filter->decode(out.data(), view.count, view.stride);
  return out;
}

}  // namespace radiosity::scene
