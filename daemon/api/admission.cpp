#include "daemon/api/admission.h"

#include <algorithm>
#include <map>

namespace eigenpose {
namespace {

/// The place of that use that was active longest ago, among those of `user`.
std::optional<std::size_t> quietest(std::span<const Place> places, uid_t user, Place::Use use) {
  std::optional<std::size_t> found;
  for (std::size_t i = 0; i < places.size(); ++i)
    if (places[i].user == user && places[i].use == use && (!found || places[i].since < places[*found].since))
      found = i;
  return found;
}

}  // namespace

Admission admit(std::span<const Place> places, std::size_t most, uid_t user) {
  if (places.size() < most) return {true, std::nullopt};
  std::map<uid_t, std::size_t> shares;
  for (const Place& place : places) ++shares[place.user];
  const std::size_t own = shares[user];
  std::size_t largest = 0;
  for (const auto& [other, share] : shares) largest = std::max(largest, share);
  std::optional<std::size_t> found;
  for (const auto& [other, share] : shares) {
    if (share < largest || share < own + 2) continue;
    found = quietest(places, other, Place::Use::idle);
    if (!found) found = quietest(places, other, Place::Use::streaming);
    if (found) return {true, found};
  }
  found = quietest(places, user, Place::Use::idle);
  return {found.has_value(), found};
}

}  // namespace eigenpose
