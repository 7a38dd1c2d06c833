// Casts rays at triangles: one a thread, or threads that fetch one after the other. In front of it come GROUP, STACK
// (entries) and what else is chosen; behind it come the tree, treeWIDTH.glsl, and
// for those of two and four walk.glsl.
//
// Of triangles that a ray meets in one place it hits the one that shows its front, then the first, as geometry::RayScene.
layout(local_size_x = GROUP) in;

layout(std430, binding = 0) readonly buffer Rays { uvec4 rays[]; };  // origin, own triangle; direction, reach
layout(std430, binding = 1) readonly buffer Nodes { uvec4 nodes[]; };
layout(std430, binding = 2) readonly buffer Triangles { uvec4 triangles[]; };
layout(std430, binding = 3) writeonly buffer Hits { uint hits[]; };
layout(std430, binding = 4) buffer Next { uint next; };
layout(location = 0) uniform uint count;

const float kSame = 1e-6;
const float kLeastDirection = 1e-20;
const uint kNothing = 0xffffffffu, kFront = 0x80000000u;

vec3 origin, direction, inverse;
uint own;
float limit;           // of the ray
float nearest, reach;  // what lies as near as the nearest hit is looked at, too
uint hit;
bool found, shows_front;

#ifdef SHARED_STACK
// The first entries of each thread lie where a multiprocessor is fastest; few rays have more.
shared uvec2 first_entries[SHARED_STACK * GROUP];
uvec2 more_entries[STACK - SHARED_STACK];
#else
uvec2 entries[STACK];
#endif
uint depth;

void push(uvec2 entry) {
#ifdef SHARED_STACK
  if (depth < SHARED_STACK)
    first_entries[depth * GROUP + gl_LocalInvocationIndex] = entry;
  else
    more_entries[depth - SHARED_STACK] = entry;
#else
  entries[depth] = entry;
#endif
  ++depth;
}

uvec2 pop() {
  --depth;
#ifdef SHARED_STACK
  return depth < SHARED_STACK ? first_entries[depth * GROUP + gl_LocalInvocationIndex]
                              : more_entries[depth - SHARED_STACK];
#else
  return entries[depth];
#endif
}

// Moller and Trumbore 1997. Triangles of no area: not a number, so no hit.
void meetTriangle(uint at) {
  const uvec4 second = triangles[3u * at + 1u];
  if (second.w == own) return;
  const vec4 corner = uintBitsToFloat(triangles[3u * at]);
  const vec3 a = uintBitsToFloat(second.xyz), b = uintBitsToFloat(triangles[3u * at + 2u].xyz);
  const vec3 p = cross(direction, b);
  const float determinant = dot(a, p), over = 1.0 / determinant;
  const vec3 s = origin - corner.xyz;
  const vec3 q = cross(s, a);
  const float u = dot(s, p) * over, v = dot(direction, q) * over, t = dot(b, q) * over;
  const float edge = corner.w * abs(over);
  if (!(u >= -edge && v >= -edge && u + v <= 1.0 + edge && t > 0.0)) return;
#ifdef ANY
  if (t < limit) found = true;
#else
  const bool front = determinant > 0.0;
  const bool ties = found && abs(t - nearest) <= kSame;
  if (!ties && !(t < nearest)) return;
  if (ties && (front != shows_front ? shows_front : hit < second.w)) return;
  nearest = t;
  reach = min(limit, t + kSame);
  hit = second.w;
  shows_front = front;
  found = true;
#endif
}

void beginWalk();
bool stepWalk();  // true: the walk is over

void beginRay(uint i) {
  const uvec4 from = rays[2u * i], way = rays[2u * i + 1u];
  origin = uintBitsToFloat(from.xyz);
  own = from.w;
  direction = uintBitsToFloat(way.xyz);
  limit = uintBitsToFloat(way.w);
  inverse = 1.0 / mix(vec3(kLeastDirection), direction, greaterThan(abs(direction), vec3(kLeastDirection)));
  nearest = reach = limit;
  hit = kNothing;
  found = shows_front = false;
  depth = 0u;
  beginWalk();
}

uint answer() {
#ifdef ANY
  return found ? 1u : 0u;
#else
  return found ? (shows_front ? hit | kFront : hit) : kNothing;
#endif
}

void main() {
#ifdef PERSISTENT
  uint i = 0u;
  bool busy = false;
  for (;;) {
    if (!busy) {
      i = atomicAdd(next, 1u);
      if (i >= count) break;
      beginRay(i);
      busy = true;
    }
    if (stepWalk()) {
      hits[i] = answer();
      busy = false;
    }
  }
#else
  const uint i = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * GROUP + gl_LocalInvocationIndex;
  if (i >= count) return;
  beginRay(i);
  while (!stepWalk()) {
  }
  hits[i] = answer();
#endif
}
