// Two boxes a node: low corner and reference, high corner and 0, of each. A reference is a node, or of a leaf kLeaf,
// first triangle and, in three bits, their number. On the stack: reference, and where the ray comes in.
const uint kLeaf = 0x80000000u;
const float kMissed = 1e30;
uint current;

float entryOf(uvec4 low, uvec4 high) {
  const vec3 one = (uintBitsToFloat(low.xyz) - origin) * inverse;
  const vec3 other = (uintBitsToFloat(high.xyz) - origin) * inverse;
  const vec3 near = min(one, other), far = max(one, other);
  const float into = max(max(near.x, near.y), max(near.z, 0.0));
  const float out_of = min(min(far.x, far.y), min(far.z, reach));
  return into <= out_of ? into : kMissed;
}

void beginWalk() { current = 0u; }

/// Whether something was met; the nearest is next then.
bool meetBoxes() {
  const uvec4 low0 = nodes[4u * current], high0 = nodes[4u * current + 1u];
  const uvec4 low1 = nodes[4u * current + 2u], high1 = nodes[4u * current + 3u];
  const float entry0 = entryOf(low0, high0), entry1 = entryOf(low1, high1);
  const bool first = entry0 <= entry1;
  const float near = min(entry0, entry1), far = max(entry0, entry1);
  if (far < kMissed) push(uvec2(first ? low1.w : low0.w, floatBitsToUint(far)));
  current = first ? low0.w : low1.w;
  return near < kMissed;
}
