// Memory of containers that are of no use any more.
#pragma once

namespace radiosity {

/// Empties it and gives its memory back, which a vector keeps when {} is assigned to it.
template <typename Container>
void giveBack(Container& container) {
  Container().swap(container);
}

}  // namespace radiosity
