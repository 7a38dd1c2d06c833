// What the allocator does with memory that is given back.
#pragma once

namespace radiosity {

/// From now on this process keeps up to 64 MiB of it, and maps only blocks of more than 32 MiB one by one. A solve
/// after an edit takes and gives back the same arrays again and again; fetched anew from the kernel each time, page by
/// page, they were a quarter of a light's edit in a room of 14,000 texels. For main(), before there are threads. Where
/// the C library is not glibc it does nothing.
void keepFreedMemory();

}  // namespace radiosity
