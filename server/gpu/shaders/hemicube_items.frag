// Item buffer: which plane (one of its triangles) is seen.
flat in uint item;
layout(location = 0) out uint seen;

void main() {
#ifdef SEE_THROUGH
  seeThrough();
#endif
  seen = item;
}
