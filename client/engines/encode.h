// Lightmap pages in the formats that engines read, with what each loses. Pure functions of values; any thread.
#pragma once

#include "client/engines/engine.h"
#include "common/bytes.h"
#include "common/image.h"
#include "common/result.h"

namespace radiosity::engines {

struct EncodedPage {
  Bytes bytes;
  /// What a stored 1 stands for, in the unit of the page; a power of two. 1, unless the page's largest value is past
  /// what halves hold (65,504) or below 1, where they would lose digits.
  double unit = 1.0;
  double square_loss = 0.0;  ///< sum over all texels and channels of (stored x unit - value)^2
  double square = 0.0;       ///< likewise of value^2
};

/// Rows from the top, the first of them row 0 of the page. Values that are negative or no numbers become 0. `unit`:
/// 0 to choose it. Errors: what the EXR library says. O(texels).
[[nodiscard]] Result<EncodedPage> encodePage(const Image& page, Encoding encoding, double unit = 0.0);

/// As EncodedPage::unit, for pages that are to share one.
[[nodiscard]] double unitFor(float largest);

}  // namespace radiosity::engines
