#include "server/scene/burial/leaf_burial.h"

#include <algorithm>
#include <glm/geometric.hpp>
#include <limits>

#include "server/scene/burial/finer_places.h"

namespace radiosity::scene {

LeafBurial::LeafBurial(const PatchScene& patches, const std::vector<LeafPiece>& pieces, const Solids& solids,
                       const Coincidence& coincidence)
    : patches_(patches), pieces_(pieces), solids_(solids), coincidence_(coincidence) {
  first_piece_.assign(patches_.leaves.size() + 1, 0);
  for (const LeafPiece& piece : pieces_) ++first_piece_[piece.leaf + 1];
  for (std::size_t i = 1; i < first_piece_.size(); ++i) first_piece_[i] += first_piece_[i - 1];
}

Solids::Answer LeafBurial::ask(std::uint32_t triangle, const glm::dvec2& texel, std::uint32_t side, Hits& hits) const {
  const auto position = positionAt(patches_.triangles[triangle], texel);
  if (coincidence_.covers(triangle, side, position, hits.work)) return {true, true};
  return solids_.ask(position, facing(triangle, side), hits);
}

/// The same of a place on the leaf that is measured.
bool LeafBurial::isBuried(std::uint32_t triangle, const glm::dvec2& texel, std::uint32_t side, Scratch& scratch) const {
  const auto position = positionAt(patches_.triangles[triangle], texel);
  if (coincidence_.covers(triangle, side, position, scratch.hits.work)) return true;
  return solids_.ask(position, facing(triangle, side), scratch.around, scratch.hits, &scratch.notes).buried;
}

LeafBurial::Extent LeafBurial::extentOf(const Contact& contact, const Pieces& pieces) const {
  const glm::dvec2 corner(contact.x, contact.y);
  const auto triangle = patches_.leaves[leafOf(contact)].triangle;
  Extent extent{{}, facing(triangle, contact.side), true, std::numeric_limits<float>::infinity()};
  const auto add = [&](std::uint32_t of) {
    for (const auto& at : {corner, corner + glm::dvec2(1, 0), corner + glm::dvec2(0, 1), corner + 1.0}) {
      const auto position = positionAt(patches_.triangles[of], at);
      extent.box.add(position);
      extent.height = std::min(extent.height, glm::dot(extent.normal, position));
    }
    extent.is_flat = extent.is_flat && facing(of, contact.side) == extent.normal;
  };
  add(triangle);
  for (auto piece = pieces.first; piece < pieces.end; ++piece) add(pieces_[piece].triangle);
  return extent;
}

/// All of the leaf is visible, as one look from all of it at once shows: most are, beside the few that a solid covers.
bool LeafBurial::isOpen(const Contact& contact, const Extent& extent, Scratch& scratch) const {
  const auto& box = extent.box;
  const auto& normal = extent.normal;
  if (!extent.is_flat || coincidence_.mayCover(contact.surface, contact.side, box)) return false;
  if (solids_.mayBury(box, normal, scratch.around)) return false;
  for (const auto& end : {box.min, box.max})
    scratch.notes.add({glm::dvec3(end) + kBurialLift * glm::dvec3(normal), normal, kNone, 0, kBurialRayLength});
  return true;
}

std::optional<BuriedPart> LeafBurial::measure(const Contact& contact, std::uint32_t count, const BurialPlaces& all,
                                              Scratch& scratch) const {
  scratch.hits.most_of_place = all.work_each;
  scratch.hits.gave_up = false;
  const auto pieces = piecesOf(leafOf(contact));
  const auto extent = extentOf(contact, pieces);
  const auto facing = extent.is_flat ? std::optional(Solids::Facing{extent.normal, extent.height}) : std::nullopt;
  solids_.findAround(extent.box, facing, scratch.around);
  // What the leaf lies in decides how many rays are asked, however short they are.
  for (const auto& end : {extent.box.min, extent.box.max}) scratch.notes.add({end, extent.normal, kNone, 0, 0.0});
  if (isOpen(contact, extent, scratch)) return std::nullopt;
  askPlaces(contact, pieces, count, scratch);
  auto outcome = sumParts(contact, pieces, scratch);
  if (count < all.many && outcome.isMixed()) {
    count = all.many;
    askPlaces(contact, pieces, count, scratch);
    outcome = sumParts(contact, pieces, scratch);
  }
  if (outcome.buried == 0) return std::nullopt;
  if (count == kCoarsePlaces && all.finer && outcome.isMixed()) {
    askFiner(contact, pieces, scratch);
    outcome = sumParts(contact, pieces, scratch);
  }
  return takePart(contact, outcome, scratch);
}

void LeafBurial::askPlaces(const Contact& contact, const Pieces& pieces, std::uint32_t count, Scratch& scratch) const {
  scratch.places.clear();
  for (std::uint32_t i = 0; i < count; ++i) {
    auto& place = scratch.places.emplace_back(placeOn(contact, pieces, i, count));
    if (place.triangle != kNone) answer(contact, place, scratch);
  }
}

/// What few of the places that all leaves are asked for tell of, each for itself, may be a strip along which no two are
/// near each other.
bool LeafBurial::mayBeStrip(const Scratch& scratch) {
  const auto& asked = scratch.asked_before;
  for (const auto answer : {Answer::kVisible, Answer::kBuried}) {
    std::size_t few = 0, alone = 0;
    for (std::uint32_t i = 0; i < asked.size(); ++i) {
      if (asked[i].answer != answer) continue;
      const auto isSame = [&](std::uint8_t k) { return asked[k].answer == answer; };
      ++few;
      alone += std::ranges::none_of(coarseBeside(i), isSame) ? 1 : 0;
    }
    if (few <= kMostOfStrips && 2 * alone > few) return true;
  }
  return false;
}

/// As those around it are; none where they do not agree.
LeafBurial::Answer LeafBurial::inferred(std::uint32_t finer, const Scratch& scratch) {
  auto answer = Answer::kNone;
  for (const auto k : coarseAround(finer)) {
    const auto there = scratch.asked_before[k].answer;
    if (there == Answer::kNone) continue;
    if (answer != Answer::kNone && answer != there) return Answer::kNone;
    answer = there;
  }
  return answer;
}

/// Of more places those around which not all is visible, or buried, and from there on along the edge.
void LeafBurial::askFiner(const Contact& contact, const Pieces& pieces, Scratch& scratch) const {
  scratch.asked_before.swap(scratch.places);
  const bool all = mayBeStrip(scratch);
  auto& places = scratch.places;
  places.clear();
  scratch.beside.clear();
  const auto askOne = [&](std::uint32_t i) {
    answer(contact, places[i], scratch);
    places[i].is_asked = true;
    scratch.beside.push_back(static_cast<std::uint8_t>(i));
  };
  for (std::uint32_t i = 0; i < kLeafLattice; ++i) {
    auto& place = places.emplace_back(placeOn(contact, pieces, i, kLeafLattice));
    if (place.triangle == kNone) continue;
    if (!all) place.answer = inferred(i, scratch);
    if (place.answer == Answer::kNone) askOne(i);
  }
  while (!all && !scratch.beside.empty()) {
    const auto i = scratch.beside.back();
    scratch.beside.pop_back();
    for (const auto k : finerAround(i)) {
      const auto& there = places[k];
      if (!there.is_asked && there.answer != Answer::kNone && there.answer != places[i].answer) askOne(k);
    }
  }
}

LeafBurial::Place LeafBurial::placeOn(const Contact& contact, const Pieces& pieces, std::uint32_t number,
                                      std::uint32_t count) const {
  Place place{glm::dvec2(contact.x, contact.y) + latticePoint(number, count), patches_.leaves[leafOf(contact)].triangle,
              0, static_cast<std::uint16_t>(number)};
  if (pieces.first == pieces.end) return place;
  const auto end = pieces_.begin() + static_cast<std::ptrdiff_t>(pieces.end);
  const auto found =
      std::find_if(pieces_.begin() + static_cast<std::ptrdiff_t>(pieces.first), end,
                   [&](const LeafPiece& p) { return triangleHolds(patches_, p.triangle, place.texel, 0.0); });
  place.part = static_cast<std::size_t>(found - pieces_.begin()) - pieces.first;
  place.triangle = found == end ? kNone : found->triangle;
  return place;
}

void LeafBurial::answer(const Contact& contact, Place& place, Scratch& scratch) const {
  const bool buried = isBuried(place.triangle, place.texel, contact.side, scratch);
  place.answer = buried ? Answer::kBuried : Answer::kVisible;
}

/// Pieces too small to hold a sample go the way of the leaf's own point.
LeafBurial::Outcome LeafBurial::sumParts(const Contact& contact, const Pieces& pieces, Scratch& scratch) const {
  const LeafPoint& point = patches_.leaves[leafOf(contact)];
  scratch.parts.assign(std::max<std::size_t>(1, pieces.end - pieces.first), {});
  for (const auto& place : scratch.places) {
    if (place.answer == Answer::kNone) continue;
    ++scratch.parts[place.part].samples;
    if (place.answer == Answer::kBuried) ++scratch.parts[place.part].buried;
  }
  Outcome outcome;
  for (std::size_t part = 0; part < scratch.parts.size(); ++part) {
    auto& p = scratch.parts[part];
    if (p.samples == 0) {
      p.samples = 1;
      p.buried = isBuried(point.triangle, glm::dvec2(point.texel), contact.side, scratch) ? 1 : 0;
    }
    const double area =
        pieces.first == pieces.end ? patches_.node_area[nodeOf(contact)] : pieces_[pieces.first + part].area;
    outcome.samples += p.samples;
    outcome.buried += p.buried;
    outcome.visible_area += area * (p.samples - p.buried) / p.samples;
  }
  return outcome;
}

/// What is visible, with the visible place nearest to the middle as its point.
BuriedPart LeafBurial::takePart(const Contact& contact, const Outcome& outcome, const Scratch& scratch) const {
  BuriedPart part{leafOf(contact), contact.side, {}, {}, static_cast<float>(outcome.visible_area)};
  const glm::dvec2 corner(contact.x, contact.y);
  part.visible.lattice = {.low = glm::vec2(corner), .points = static_cast<std::uint32_t>(scratch.places.size())};
  const auto& point = patches_.leaves[part.leaf];
  if (outcome.visible_area > 0.0) part.point = {point.texel, point.triangle, false};
  double nearest = std::numeric_limits<double>::infinity();
  for (const auto& place : scratch.places) {
    if (place.answer != Answer::kVisible) continue;
    part.visible.add(place.number, place.triangle);
    const double distance = glm::distance(place.texel, corner + 0.5);
    if (distance >= nearest || outcome.visible_area <= 0.0) continue;
    nearest = distance;
    part.point = {glm::vec2(place.texel), place.triangle, false};
  }
  part.visible.order();  // here, where leaves are measured side by side
  return part;
}

}  // namespace radiosity::scene
