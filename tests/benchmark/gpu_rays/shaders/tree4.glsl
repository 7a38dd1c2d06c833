// Four boxes a node: low x of all, low y, low z, high x, y, z, references as in tree2.glsl. On the stack: likewise.
const uint kLeaf = 0x80000000u;
const float kMissed = 1e30;
uint current;

void beginWalk() { current = 0u; }

void order(inout uvec2 a, inout uvec2 b) {  // entries are not negative: their bits are in order
  if (b.y < a.y) {
    const uvec2 c = a;
    a = b;
    b = c;
  }
}

/// Whether something was met; the nearest is next then.
bool meetBoxes() {
  const uint at = 7u * current;
  const vec4 one_x = (uintBitsToFloat(nodes[at]) - origin.x) * inverse.x;
  const vec4 one_y = (uintBitsToFloat(nodes[at + 1u]) - origin.y) * inverse.y;
  const vec4 one_z = (uintBitsToFloat(nodes[at + 2u]) - origin.z) * inverse.z;
  const vec4 other_x = (uintBitsToFloat(nodes[at + 3u]) - origin.x) * inverse.x;
  const vec4 other_y = (uintBitsToFloat(nodes[at + 4u]) - origin.y) * inverse.y;
  const vec4 other_z = (uintBitsToFloat(nodes[at + 5u]) - origin.z) * inverse.z;
  const uvec4 reference = nodes[at + 6u];
  const vec4 into = max(max(min(one_x, other_x), min(one_y, other_y)), max(min(one_z, other_z), vec4(0.0)));
  const vec4 out_of = min(min(max(one_x, other_x), max(one_y, other_y)), min(max(one_z, other_z), vec4(reach)));
  const vec4 entry = mix(vec4(kMissed), into, lessThanEqual(into, out_of));
  uvec2 a = uvec2(reference.x, floatBitsToUint(entry.x)), b = uvec2(reference.y, floatBitsToUint(entry.y));
  uvec2 c = uvec2(reference.z, floatBitsToUint(entry.z)), d = uvec2(reference.w, floatBitsToUint(entry.w));
  order(a, b);
  order(c, d);
  order(a, c);
  order(b, d);
  order(b, c);
  const uint missed = floatBitsToUint(kMissed);
  if (d.y < missed) push(d);
  if (c.y < missed) push(c);
  if (b.y < missed) push(b);
  current = a.x;
  return a.y < missed;
}
