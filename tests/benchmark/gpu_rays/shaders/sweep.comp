// One sweep of the equation over kept hits: what each leaf sends is its emission and its reflectance times the mean of
// what the leaves that its rays met send. Hits: leaf after leaf, or, TRANSPOSED, the first of all leaves, the second...
layout(local_size_x = GROUP) in;

layout(std430, binding = 0) readonly buffer Hits { uint hits[]; };
layout(std430, binding = 1) readonly buffer Sent { vec4 sent[]; };  // and last, that of nothing: 0
layout(std430, binding = 2) readonly buffer Reflectance { vec4 reflectance[]; };
layout(std430, binding = 3) readonly buffer Emission { vec4 emission[]; };
layout(std430, binding = 4) writeonly buffer Sends { vec4 sends[]; };
layout(location = 0) uniform uint leaves;

void main() {
  const uint leaf = gl_GlobalInvocationID.x;
  if (leaf >= leaves) return;
  vec4 sum = vec4(0.0);
#ifdef TRANSPOSED
  for (uint k = 0u; k < HITS; ++k) sum += sent[hits[k * leaves + leaf]];
#else
  for (uint k = 0u; k < HITS; ++k) sum += sent[hits[leaf * HITS + k]];
#endif
  sends[leaf] = emission[leaf] + reflectance[leaf] * (sum * (1.0 / float(HITS)));
}
