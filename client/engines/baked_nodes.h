// What of a lit scene's nodes and animations must go so that an engine shows nothing twice and nothing that the solve
// did not see. In place; any thread. What is not as glTF has it is left alone: the server wrote the file.
#pragma once

#include <string>
#include <vector>

#include "client/engines/lit_scene.h"

namespace radiosity::engines {

/// Nodes that KHR_node_visibility hides, with all below them, lose their meshes and lamps: not every engine reads the
/// extension. To be called before takeLightsOut(), which tells of lamps that were lit.
void takeHiddenOut(Json& gltf);

/// Takes lamps out, which are in the lightmaps, and skies that engines would light with. The node of a lamp that was
/// solved for, which is one of the default scene, keeps what the lamp was as "extras": {"bakedLight": {...}}. Returns
/// the names of these nodes, one for each node.
std::vector<std::string> takeLightsOut(Json& gltf);

/// Takes out channels of animations that move what is no more: weights of nodes without a mesh, and members of
/// extensions that were taken out; and animations without a channel. To be called after all else.
void takeDeadChannelsOut(Json& gltf);

}  // namespace radiosity::engines
