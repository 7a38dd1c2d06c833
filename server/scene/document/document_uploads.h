// Bytes of the buffers and images that a patch appends to a document. Pure but for the look-up it is given; any thread.
#pragma once

#include "common/result.h"
#include "server/scene/document/document.h"

namespace radiosity::scene {

/// Fills Document::buffers and ::images up to the length of /buffers and /images. The URI of an appended entry is a
/// data URI or an upload's; it is taken out of the JSON, and a missing `byteLength` is filled in. Errors: kInvalidScene
/// with the place, kNotFound for an upload that is not there (any more), kTooLarge past limits.max_file_bytes in all.
[[nodiscard]] Result<void> attachUploads(Document& document, const FindUpload& uploads, const ImportLimits& limits);

}  // namespace radiosity::scene
