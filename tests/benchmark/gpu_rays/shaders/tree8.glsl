// Eight boxes a node in 80 bytes (Ylitie, Karras and Laine 2017, "Efficient incoherent ray traversal on GPUs through
// compressed wide BVHs"): corner, exponents of the grid and which children are inner ones; first child, first triangle
// and a byte for each child; grid planes, a byte each. A child's byte: empty 0; inner 1 in the upper three bits and
// 24 + slot below; leaf, as many ones as it has triangles, and which is its first.
//
// A group of nodes: first child; met ones in the upper eight bits in the order of the ray's octant, inner ones in the
// lower eight. On the stack: such groups.
uvec2 node_group, triangle_group;
uint octant;  // inverse: slot ^ octant is larger the sooner a ray meets it
const uint kNoNodes = 0x00ffffffu;

void beginWalk() {
  octant = (direction.x < 0.0 ? 0u : 4u) | (direction.y < 0.0 ? 0u : 2u) | (direction.z < 0.0 ? 0u : 1u);
  node_group = uvec2(0u, 0x80000000u);
  triangle_group = uvec2(0u);
}

vec3 planesOf(uint x, uint y, uint z, uint shift) {
  return vec3(float((x >> shift) & 255u), float((y >> shift) & 255u), float((z >> shift) & 255u));
}

uint meetFour(uint meta, uvec3 near, uvec3 far, vec3 steps, vec3 start) {
  const uint inner = (((meta & (meta << 1)) & 0x10101010u) >> 4) * 255u;
  const uint index = (meta ^ ((octant * 0x01010101u) & inner)) & 0x1f1f1f1fu;
  const uint bits = (meta >> 5) & 0x07070707u;
  uint met = 0u;
  for (uint shift = 0u; shift < 32u; shift += 8u) {
    const vec3 low = planesOf(near.x, near.y, near.z, shift) * steps + start;
    const vec3 high = planesOf(far.x, far.y, far.z, shift) * steps + start;
    const float into = max(max(low.x, low.y), max(low.z, 0.0));
    const float out_of = min(min(high.x, high.y), min(high.z, reach));
    if (into <= out_of) met |= ((bits >> shift) & 255u) << ((index >> shift) & 255u);
  }
  return met;
}

void meetNode(uint node) {
  const uvec4 head = nodes[5u * node], refer = nodes[5u * node + 1u];
  const uvec4 low_xy = nodes[5u * node + 2u], low_z_high_x = nodes[5u * node + 3u], high_yz = nodes[5u * node + 4u];
  const uvec3 exponents = uvec3(head.w & 255u, (head.w >> 8) & 255u, (head.w >> 16) & 255u);
  const vec3 steps = uintBitsToFloat(exponents << 23) * inverse, start = (uintBitsToFloat(head.xyz) - origin) * inverse;
  const bvec3 down = lessThan(inverse, vec3(0.0));
  const uvec2 near_x = down.x ? low_z_high_x.zw : low_xy.xy, far_x = down.x ? low_xy.xy : low_z_high_x.zw;
  const uvec2 near_y = down.y ? high_yz.xy : low_xy.zw, far_y = down.y ? low_xy.zw : high_yz.xy;
  const uvec2 near_z = down.z ? high_yz.zw : low_z_high_x.xy, far_z = down.z ? low_z_high_x.xy : high_yz.zw;
  const uint met =
      meetFour(refer.z, uvec3(near_x.x, near_y.x, near_z.x), uvec3(far_x.x, far_y.x, far_z.x), steps, start) |
      meetFour(refer.w, uvec3(near_x.y, near_y.y, near_z.y), uvec3(far_x.y, far_y.y, far_z.y), steps, start);
  node_group = uvec2(refer.x, (met & ~kNoNodes) | (head.w >> 24));
  triangle_group = uvec2(refer.y, met & kNoNodes);
}

void meetNextTriangle() {
  const uint which = uint(findLSB(triangle_group.y));
  triangle_group.y &= triangle_group.y - 1u;
  meetTriangle(triangle_group.x + which);
}

void meetNextNode() {
  const uint bit = uint(findMSB(node_group.y)), inner = node_group.y;
  node_group.y &= ~(1u << bit);
  if (node_group.y > kNoNodes) push(node_group);
  const uint slot = (bit - 24u) ^ octant;
  meetNode(node_group.x + uint(bitCount(inner & ((1u << slot) - 1u))));
}

// A node, and with WHILE all triangles right below it; else one triangle, or a node.
bool stepWalk() {
#ifdef WHILE
  meetNextNode();
  while (triangle_group.y != 0u) {
    meetNextTriangle();
#ifdef ANY
    if (found) return true;
#endif
  }
#else
  if (triangle_group.y != 0u)
    meetNextTriangle();
  else
    meetNextNode();
#ifdef ANY
  if (found) return true;
#endif
  if (triangle_group.y != 0u) return false;
#endif
  if (node_group.y > kNoNodes) return false;
  if (depth == 0u) return true;
  node_group = pop();
  return false;
}
