#include "server/sessions/resumptions.h"

#include <openssl/rand.h>

#include <algorithm>
#include <utility>

#include "absl/strings/escaping.h"
#include "server/models/content_id.h"

namespace deform::server {

absl::StatusOr<std::string> MakeResumeToken() {
  unsigned char bytes[16];
  if (RAND_bytes(bytes, sizeof(bytes)) != 1) {
    return absl::InternalError("no random numbers for a resume token");
  }
  return absl::BytesToHexString(
      absl::string_view(reinterpret_cast<const char*>(bytes), sizeof(bytes)));
}

std::string ResumeKeyOf(absl::string_view token) {
  return ContentHash("resume token").Add(token).Finish();
}

void Resumptions::Keep(const std::string& key, Place place, TimePoint now) {
  DropExpired(now);
  places_.insert_or_assign(
      key, Kept{.place = std::move(place), .until = now + grace_});
  while (places_.size() > limit_) {
    places_.erase(std::min_element(places_.begin(), places_.end(),
                                   [](const auto& a, const auto& b) {
                                     return a.second.until < b.second.until;
                                   }));
  }
}

std::optional<Place> Resumptions::Take(const std::string& key, TimePoint now) {
  DropExpired(now);
  const auto found = places_.find(key);
  if (found == places_.end()) return std::nullopt;
  Place place = std::move(found->second.place);
  places_.erase(found);
  return place;
}

Place* Resumptions::Find(int64_t participant) {
  for (auto& [key, kept] : places_) {
    if (kept.place.participant == participant) return &kept.place;
  }
  return nullptr;
}

const Place* Resumptions::Find(const std::string& key, TimePoint now) const {
  const auto found = places_.find(key);
  if (found == places_.end() || found->second.until <= now) return nullptr;
  return &found->second.place;
}

void Resumptions::DropExpired(TimePoint now) {
  std::erase_if(places_,
                [now](const auto& kept) { return kept.second.until <= now; });
}

}  // namespace deform::server
