#pragma once

/// The rooms of the source tree and who includes whom, as a picture.

#include <map>
#include <string>
#include <utility>

namespace eigenpose::layering {

/// (room that includes, room that is included) → number of includes.
using Edges = std::map<std::pair<std::string, std::string>, int>;

/// Floor of every room: 0 where it includes no other room, else one more than the highest room it includes.
/// @throws std::logic_error when rooms include each other in a circle.
std::map<std::string, int> floors(const Edges& edges);

/// An SVG with a box for every room, lowest floor at the bottom, and a line for every edge that no longer
/// path implies.
std::string draw(const Edges& edges);

/// The same as text: floor by floor, each room with what it includes and how often.
std::string describe(const Edges& edges);

}  // namespace eigenpose::layering
