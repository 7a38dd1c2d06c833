// References kept on disk, because path tracing one takes longer than all that is measured against it: texels and
// points each in a file of their own, since points outlive a change of the texels' layout. A file is named by a hash of
// everything its values depend on: triangles, materials, for texels their layout, the options, and what the path tracer
// of today answers to a small probe, so that a change of the tracer makes old files unused. Any thread.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "tests/accuracy/compare.h"

namespace radiosity::accuracy {

/// 16 hexadecimal digits. Costs some thousand paths.
[[nodiscard]] std::string referenceKey(const LitScene& lit, const ReferenceOptions& options, ReferencePart part);

/// Whole or not at all: written beside its place, then renamed. Throws std::runtime_error.
void saveReference(const Reference& reference, const std::filesystem::path& file);

/// Nothing where the file is missing, cut short, too long, or not one of ours.
[[nodiscard]] std::optional<Reference> loadReference(const std::filesystem::path& file);

struct StoredReference {
  Reference reference;
  bool from_disk = false;
};
/// Loads a part from `folder`, or makes it and saves it there.
[[nodiscard]] StoredReference findPart(const LitScene& lit, const ReferenceOptions& options, ReferencePart part,
                                       const std::filesystem::path& folder);
/// Both parts; from disk where both are.
[[nodiscard]] StoredReference findReference(const LitScene& lit, const ReferenceOptions& options,
                                            const std::filesystem::path& folder);

}  // namespace radiosity::accuracy
