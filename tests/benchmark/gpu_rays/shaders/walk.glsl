// How the trees of tree2.glsl and tree4.glsl are walked: each turn meets one node's boxes or one leaf's triangles; with
// WHILE, boxes until there is a leaf (Aila and Laine 2009, "Understanding the efficiency of ray traversal on GPUs").
bool popNext() {
  while (depth > 0u) {
    const uvec2 entry = pop();
    if (uintBitsToFloat(entry.y) > reach) continue;
    current = entry.x;
    return true;
  }
  return false;
}

bool stepWalk() {
#ifdef WHILE
  while ((current & kLeaf) == 0u)
    if (!meetBoxes() && !popNext()) return true;
#else
  if ((current & kLeaf) == 0u) return !meetBoxes() && !popNext();
#endif
  const uint begin = (current & ~kLeaf) >> 3, end = begin + (current & 7u);
  for (uint t = begin; t < end; ++t) meetTriangle(t);
#ifdef ANY
  if (found) return true;
#endif
  return !popNext();
}
