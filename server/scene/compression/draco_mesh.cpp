#include "server/scene/compression/draco_mesh.h"

#include <draco/compression/config/compression_shared.h>
#include <draco/compression/entropy/symbol_decoding.h>
#include <draco/compression/mesh/mesh_edgebreaker_decoder.h>
#include <draco/compression/mesh/mesh_sequential_decoder.h>
#include <draco/core/varint_decoding.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <utility>

namespace radiosity::scene {
namespace {

/// Measured at the peak of decoding a grid of two million faces: up to 80 bytes a face, beside attributes and results.
constexpr std::uint64_t kBytesAFace = 128;
/// More of each attribute that the traversal has seams of: a table of its corners, where they are, and vertices.
constexpr std::uint64_t kBytesAFaceAndSeams = 40;
/// The only version of which glTF's extension speaks.
constexpr std::uint16_t kBitstream = DRACO_BITSTREAM_VERSION(2, 2);
/// Of each point in each attribute: an index of values. And of each component: a whole number, from which it is made.
constexpr std::uint64_t kBytesAPoint = sizeof(std::uint32_t), kBytesAComponent = sizeof(std::int32_t);

/// What is wrong, as the library's own status does not say.
struct Fault {
  ErrorCode code = ErrorCode::kBadInput;
  std::string text;
};

/// Counts of a stream's connectivity, read ahead of the decoder, which would make tables of that size at once.
struct Counts {
  std::uint32_t vertices = 0, faces = 0;
  std::uint8_t seams = 0;  ///< attributes that have some
  [[nodiscard]] std::uint64_t workingBytes() const {
    return dracoWorkingBytes(faces) + kBytesAFaceAndSeams * faces * seams;
  }
};

bool peekSequential(draco::DecoderBuffer buffer, Counts& counts) {
  return draco::DecodeVarint(&counts.faces, &buffer) && draco::DecodeVarint(&counts.vertices, &buffer);
}

/// Behind the counts of vertices and faces stands how often a traversal splits, which makes vertices as well.
bool peekEdgebreaker(draco::DecoderBuffer buffer, Counts& counts) {
  std::uint32_t vertices = 0, symbols = 0, splits = 0;
  const bool all = draco::DecodeVarint(&vertices, &buffer) && draco::DecodeVarint(&counts.faces, &buffer) &&
                   buffer.Decode(&counts.seams) && draco::DecodeVarint(&symbols, &buffer) &&
                   draco::DecodeVarint(&splits, &buffer);
  if (!all || splits > counts.faces || vertices > std::numeric_limits<std::uint32_t>::max() - splits) return false;
  counts.vertices = vertices + splits;
  return true;
}

/// One of the library's decoders, stopped where a stream has more than was declared.
template <typename Base>
class BoundedDecoder : public Base {
 public:
  BoundedDecoder(const DracoRequest& request, bool (*peek)(draco::DecoderBuffer, Counts&), Fault& fault)
      : request_(request), peek_(peek), fault_(fault) {}

  /// That decoding all attributes took, asked for or not.
  [[nodiscard]] std::uint64_t attributeBytes() const { return attribute_bytes_; }

 protected:
  bool DecodeConnectivity() override {
    if (this->bitstream_version() != kBitstream) {
      return stop(ErrorCode::kUnsupported,
                  "is of Draco's bitstream " + std::to_string(this->bitstream_version() >> 8U) + "." +
                      std::to_string(this->bitstream_version() & 0xFFU) + "; glTF allows only 2.2");
    }
    Counts counts;
    if (!peek_(*this->buffer(), counts)) return false;
    if (request_.faces && counts.faces != *request_.faces) {
      return stop(ErrorCode::kInvalidScene, "the stream has " + std::to_string(counts.faces) +
                                                " triangles, but the accessor of its indices declares " +
                                                std::to_string(*request_.faces));
    }
    if (counts.faces > std::numeric_limits<std::int32_t>::max() / 4 ||
        counts.vertices > std::max(4 * std::uint64_t{counts.faces}, std::uint64_t{request_.points}) ||
        counts.workingBytes() > request_.room) {
      return stop(ErrorCode::kTooLarge, "the stream claims " + std::to_string(counts.faces) + " triangles and " +
                                            std::to_string(counts.vertices) + " vertices, with seams of " +
                                            std::to_string(counts.seams) + " attributes");
    }
    left_ = std::min(request_.room - counts.workingBytes(), request_.attribute_room);
    return Base::DecodeConnectivity();
  }

  /// Here all attributes are described, and none has values.
  bool DecodeAllAttributes() override {
    const auto& cloud = *this->point_cloud();
    if (cloud.num_points() != request_.points) {
      return stop(ErrorCode::kInvalidScene, "the stream has " + std::to_string(cloud.num_points()) +
                                                " vertices, but the accessors declare " +
                                                std::to_string(request_.points));
    }
    std::uint64_t each = 0;
    for (std::int32_t i = 0; i < cloud.num_attributes(); ++i)
      each += static_cast<std::uint64_t>(cloud.attribute(i)->byte_stride()) + kBytesAPoint +
              kBytesAComponent * cloud.attribute(i)->num_components();
    if (each > left_ / std::max<std::uint64_t>(request_.points, 1))
      return stop(ErrorCode::kTooLarge,
                  "the stream's attributes claim " + std::to_string(each) + " bytes for each vertex");
    attribute_bytes_ = each * request_.points;
    return Base::DecodeAllAttributes();
  }

  bool stop(ErrorCode code, std::string text) {
    fault_ = {code, std::move(text)};
    return false;
  }

 private:
  const DracoRequest& request_;
  bool (*peek_)(draco::DecoderBuffer, Counts&);
  Fault& fault_;
  std::uint64_t left_ = 0, attribute_bytes_ = 0;
};

/// Whether no more bits tell how texture coordinates turn than there are values of them. `buffer` stands behind the
/// bytes that name the prediction scheme, before the values that it corrects.
bool hasFewTurns(draco::DecoderBuffer buffer, std::size_t values, std::size_t components) {
  std::uint8_t compressed = 0, width = 0;
  if (!buffer.Decode(&compressed)) return true;  // the decoder will say so
  if (compressed > 0) {
    std::vector<std::uint32_t> symbols(values * components);
    if (!draco::DecodeSymbols(static_cast<std::uint32_t>(symbols.size()), static_cast<int>(components), &buffer,
                              symbols.data()))
      return true;
  } else {
    if (!buffer.Decode(&width)) return true;
    buffer.Advance(static_cast<std::int64_t>(values * components * width));
    if (buffer.remaining_size() < 0) return true;
  }
  std::int32_t turns = 0;
  return !buffer.Decode(&turns) || turns < 0 || static_cast<std::uint32_t>(turns) <= values;
}

using Sequential = BoundedDecoder<draco::MeshSequentialDecoder>;

class Edgebreaker : public BoundedDecoder<draco::MeshEdgebreakerDecoder> {
 public:
  explicit Edgebreaker(const DracoRequest& request, Fault& fault) : BoundedDecoder(request, peekEdgebreaker, fault) {}

  /// Called when a prediction scheme is made for an attribute, whose values follow in the buffer. That for texture
  /// coordinates would take any count of bits, up to two billion: seconds, and a quarter of a gigabyte, of a few bytes.
  [[nodiscard]] const draco::MeshAttributeIndicesEncodingData* GetAttributeEncodingData(int attribute) const override {
    const auto* data = MeshEdgebreakerDecoder::GetAttributeEncodingData(attribute);
    auto& self = const_cast<Edgebreaker&>(*this);  // the library asks what is constant, and lets nothing else be asked
    const auto* described = self.point_cloud()->attribute(attribute);
    if (data == nullptr || described == nullptr) return data;
    const auto& buffer = *self.buffer();
    const auto method = static_cast<std::int8_t>(buffer.data_head()[-2]);
    if (method == draco::MESH_PREDICTION_TEX_COORDS_DEPRECATED) {
      self.stop(ErrorCode::kUnsupported, "predicts texture coordinates by a method of bitstreams before 2.2");
      return nullptr;
    }
    if (method == draco::MESH_PREDICTION_TEX_COORDS_PORTABLE &&
        !hasFewTurns(buffer, data->encoded_attribute_value_index_to_corner_map.size(), described->num_components())) {
      self.stop(ErrorCode::kBadInput, "the Draco stream claims more turns than it has texture coordinates");
      return nullptr;
    }
    return data;
  }
};

/// Returns what decoding its attributes took.
Result<std::uint64_t> decodeInto(std::span<const std::uint8_t> stream, const DracoRequest& request, draco::Mesh& mesh) {
  const auto bad = [&](ErrorCode code, std::string text) { return fail(code, std::move(text), request.where); };
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(stream.data()), stream.size());
  draco::DracoHeader header;
  auto ahead = buffer;
  if (!draco::PointCloudDecoder::DecodeHeader(&ahead, &header).ok())
    return bad(ErrorCode::kBadInput, "is no Draco stream");
  if (header.encoder_type != draco::TRIANGULAR_MESH)
    return bad(ErrorCode::kUnsupported, "is a Draco stream of points; glTF allows only triangles");
  Fault fault;
  const draco::DecoderOptions options;
  draco::Status status;
  std::uint64_t bytes = 0;
  const auto decode = [&](auto&& decoder) {
    status = decoder.Decode(options, &buffer, &mesh);
    bytes = decoder.attributeBytes();
  };
  if (header.encoder_method == draco::MESH_SEQUENTIAL_ENCODING) {
    decode(Sequential(request, peekSequential, fault));
  } else if (header.encoder_method == draco::MESH_EDGEBREAKER_ENCODING) {
    decode(Edgebreaker(request, fault));
  } else {
    return bad(ErrorCode::kUnsupported, "is coded by a method that Draco 1.5.5 does not know");
  }
  if (!fault.text.empty()) return bad(fault.code, std::move(fault.text));
  if (status.ok()) return bytes;
  return bad(ErrorCode::kBadInput, "the Draco stream cannot be decoded: " + status.error_msg_string());
}

Result<std::vector<std::uint32_t>> cornersOf(const draco::Mesh& mesh, const DracoRequest& request) {
  std::vector<std::uint32_t> corners;
  corners.reserve(std::size_t{3} * mesh.num_faces());
  for (std::uint32_t f = 0; f < mesh.num_faces(); ++f) {
    for (const auto& point : mesh.face(draco::FaceIndex(f))) {
      if (point.value() >= mesh.num_points())
        return fail(ErrorCode::kBadInput, "a triangle of the Draco stream has a vertex that is not there",
                    request.where);
      corners.push_back(point.value());
    }
  }
  return corners;
}

int componentTypeOf(draco::DataType type) {
  switch (type) {
    case draco::DT_INT8:
      return 5120;
    case draco::DT_UINT8:
    case draco::DT_BOOL:
      return 5121;
    case draco::DT_INT16:
      return 5122;
    case draco::DT_UINT16:
      return 5123;
    case draco::DT_INT32:
      return 5124;  // none of glTF's, but its numbers may fit one that is
    case draco::DT_UINT32:
      return 5125;
    case draco::DT_FLOAT32:
      return 5126;
    default:
      return 0;
  }
}

template <typename T>
std::int64_t loadAs(const std::uint8_t* from) {
  T value;
  std::memcpy(&value, from, sizeof value);
  return value;
}

std::int64_t loadInteger(const std::uint8_t* from, int type) {
  switch (type) {
    case 5120:
      return loadAs<std::int8_t>(from);
    case 5121:
      return loadAs<std::uint8_t>(from);
    case 5122:
      return loadAs<std::int16_t>(from);
    case 5123:
      return loadAs<std::uint16_t>(from);
    case 5124:
      return loadAs<std::int32_t>(from);
    default:
      return loadAs<std::uint32_t>(from);
  }
}

/// Little end first, as all of glTF. False: it does not fit.
bool storeInteger(std::int64_t value, int type, std::uint8_t* to) {
  const bool is_signed = type == 5120 || type == 5122;
  const auto bits = 8 * componentBytes(type);
  const auto most = (std::int64_t{1} << (bits - (is_signed ? 1 : 0))) - 1;
  if (value > most || value < (is_signed ? -most - 1 : 0)) return false;
  for (std::size_t i = 0; i < componentBytes(type); ++i) to[i] = static_cast<std::uint8_t>(value >> (8 * i));
  return true;
}

class AttributeReader {
 public:
  AttributeReader(const draco::Mesh& mesh, const DracoAttribute& asked, const std::string& where)
      : mesh_(mesh), asked_(asked), where_(where), attribute_(mesh.GetAttributeByUniqueId(asked.id)) {}

  Result<Bytes> read() {
    if (attribute_ == nullptr)
      return bad(where_, "the Draco stream has no attribute of id " + std::to_string(asked_.id));
    type_ = componentTypeOf(attribute_->data_type());
    if (attribute_->num_components() != asked_.components)
      return bad(asked_.where, "has " + std::to_string(asked_.components) + " components; the Draco stream has " +
                                   std::to_string(attribute_->num_components()));
    const bool same_kind = type_ != 0 && (type_ == 5126) == (asked_.component_type == 5126);
    if (!same_kind) return bad(asked_.where, "has another component type than the Draco stream");
    const auto stride = static_cast<std::size_t>(attribute_->byte_stride());
    const auto values = static_cast<std::size_t>(attribute_->size());
    if (attribute_->buffer() == nullptr || attribute_->byte_offset() != 0 ||
        attribute_->buffer()->data_size() < values * stride)
      return bad(where_, "the Draco stream has too few values");
    Bytes out(mesh_.num_points() * asked_.components * componentBytes(asked_.component_type));
    auto* to = out.data();
    for (std::uint32_t p = 0; p < mesh_.num_points(); ++p) {
      const auto value = attribute_->mapped_index(draco::PointIndex(p));
      if (value.value() >= values) return bad(where_, "the Draco stream has too few values");
      if (!copyElement(attribute_->buffer()->data() + value.value() * stride, to))
        return bad(asked_.where, "numbers of the Draco stream do not fit its component type");
      to += asked_.components * componentBytes(asked_.component_type);
    }
    return out;
  }

 private:
  bool copyElement(const std::uint8_t* from, std::uint8_t* to) const {
    const auto size = componentBytes(asked_.component_type);
    if (type_ == asked_.component_type) {
      std::memcpy(to, from, asked_.components * size);
      return true;
    }
    for (std::size_t c = 0; c < asked_.components; ++c)
      if (!storeInteger(loadInteger(from + c * componentBytes(type_), type_), asked_.component_type, to + c * size))
        return false;
    return true;
  }

  static tl::unexpected<Error> bad(const std::string& where, std::string what) {
    return fail(ErrorCode::kInvalidScene, std::move(what), where);
  }

  const draco::Mesh& mesh_;
  const DracoAttribute& asked_;
  const std::string& where_;
  const draco::PointAttribute* attribute_;
  int type_ = 0;
};

}  // namespace

std::size_t componentBytes(int component_type) { return component_type <= 5121 ? 1 : component_type <= 5123 ? 2 : 4; }

std::uint64_t dracoWorkingBytes(std::uint64_t faces) { return kBytesAFace * faces; }

Result<DracoMesh> decodeDraco(std::span<const std::uint8_t> stream, const DracoRequest& request) {
  draco::Mesh mesh;
  const auto bytes = decodeInto(stream, request, mesh);
  if (!bytes) return tl::unexpected(bytes.error());
  auto corners = cornersOf(mesh, request);
  if (!corners) return tl::unexpected(corners.error());
  DracoMesh out{std::move(*corners), {}, *bytes};
  for (const auto& asked : request.attributes) {
    auto values = AttributeReader(mesh, asked, request.where).read();
    if (!values) return tl::unexpected(values.error());
    out.attributes.push_back(std::move(*values));
  }
  return out;
}

}  // namespace radiosity::scene
