// Primitives that are there as Draco streams. Lives for one call of decompressGeometry, on its thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "server/scene/compression/draco_mesh.h"
#include "server/scene/document/decoded_buffer.h"
#include "server/scene/document/document.h"

namespace radiosity::scene {

class DracoPrimitives {
 public:
  static constexpr const char* kName = "KHR_draco_mesh_compression";

  DracoPrimitives(Document& document, DecodedBuffer& out)
      : document_(document), out_(out), attribute_room_(kAttributeRooms * out.room()) {}

  /// Of a checked document. `pointer`: of the primitive.
  [[nodiscard]] Result<void> decode(Json& primitive, const std::string& pointer);

  /// Views whose streams were decoded.
  [[nodiscard]] const std::set<std::size_t>& views() const { return views_; }
  /// Puts the last of the views that were made in the place of one that nobody needs any more.
  void reuse(std::size_t view);

 private:
  /// All streams together may have so many times as many bytes of attributes as geometry may, once it is decoded: a
  /// short stream may have many that nobody asks for, and many primitives may name it.
  static constexpr std::uint64_t kAttributeRooms = 2;
  /// A stream's attribute, or its indices, and the accessor that declares it; both may serve many primitives.
  struct Wanted {
    std::string name;  ///< "" for indices
    std::int64_t id = kIndices;
    std::size_t accessor = kNone;
  };
  static constexpr std::int64_t kIndices = -1;
  static constexpr std::size_t kNone = static_cast<std::size_t>(-1);
  using Key = std::tuple<std::size_t, std::int64_t, std::size_t>;  ///< view, id, accessor

  [[nodiscard]] std::vector<Wanted> wantedBy(const Json& primitive, const Json& extension) const;
  [[nodiscard]] bool isPlain(const std::vector<Wanted>& wanted) const;
  [[nodiscard]] Result<DracoRequest> requestFor(const std::vector<Wanted>& wanted, const std::string& pointer) const;
  [[nodiscard]] Result<std::span<const std::uint8_t>> streamOf(std::size_t view, const std::string& where) const;
  [[nodiscard]] Result<void> decodeInto(std::size_t view, const std::vector<Wanted>& wanted,
                                        const std::string& pointer);
  [[nodiscard]] Result<void> addIndices(const Key& key, const DracoMesh& mesh, std::size_t points);
  void addAttribute(const Key& key, const Bytes& values);
  /// Gives an accessor its data: the one that declared it, or, where that has other data, a copy.
  Json& fill(const Key& key, Bytes bytes, Json view);
  [[nodiscard]] std::string at(const std::string& pointer) const { return place(document_.name, pointer); }

  Document& document_;
  DecodedBuffer& out_;
  std::uint64_t attribute_room_;
  std::map<Key, std::size_t> done_;  ///< the accessors that have the data
  std::set<std::size_t> filled_;     ///< accessors that were given data
  std::set<std::size_t> views_;
  std::vector<std::size_t> readers_;  ///< of the views made, which are the last of all: their accessors
};

}  // namespace radiosity::scene
