#include "client/load/answer_book.h"

#include <algorithm>

namespace deform {

void AnswerBook::Note(int editor, uint64_t revision, uint64_t sequence) {
  std::deque<Told>& told = told_[editor];
  told.push_back({revision, sequence});
  if (told.size() > kKept) told.pop_front();
}

AnswerBook::Known AnswerBook::FindOf(const std::deque<Told>& told,
                                     uint64_t revision,
                                     uint64_t& sequence) const {
  const auto after = std::upper_bound(
      told.begin(), told.end(), revision,
      [](uint64_t wanted, const Told& t) { return wanted < t.revision; });
  if (after == told.begin()) {
    return after == told.end() ? Known::kNotYet : Known::kNever;
  }
  const Told& before = *(after - 1);
  sequence = before.sequence;
  if (before.revision == revision) return Known::kYes;
  if (after == told.end()) return Known::kNotYet;
  return after->sequence == sequence ? Known::kYes : Known::kNever;
}

AnswerBook::Known AnswerBook::Find(uint64_t revision,
                                   std::vector<uint64_t>& sequences) const {
  sequences.resize(told_.size());
  Known all = Known::kYes;
  for (size_t e = 0; e < told_.size(); ++e) {
    const Known known = FindOf(told_[e], revision, sequences[e]);
    if (known == Known::kNever) return known;
    if (known == Known::kNotYet) all = known;
  }
  return all;
}

}  // namespace deform
