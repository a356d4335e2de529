#include "core/files/text_scanner.h"

#include <cmath>
#include <string>
#include <system_error>

#include "absl/strings/charconv.h"
#include "absl/strings/escaping.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace deform {
namespace {

// A slot's length is 16 bits; nobody writes a number of a thousand digits.
constexpr size_t kMaxNumberLength = 1000;

bool IsBlank(char c) { return c == ' ' || c == '\t' || c == '\v' || c == '\f'; }
bool IsLineEnd(char c) { return c == '\n' || c == '\r'; }

// A word of the file as part of a message.
std::string Quoted(absl::string_view word) {
  constexpr size_t kShown = 40;
  return absl::StrCat("\"", absl::CHexEscape(word.substr(0, kShown)),
                      word.size() > kShown ? "...\"" : "\"");
}

}  // namespace

bool TextScanner::StepOverLineEnd() {
  if (at_ == bytes_.size() || !IsLineEnd(bytes_[at_])) return false;
  const bool pair = bytes_.substr(at_, 2) == "\r\n";
  at_ += pair ? 2 : 1;
  return true;
}

bool TextScanner::NextLine() {
  if (within_line_) {
    within_line_ = false;
    while (at_ < bytes_.size() && !IsLineEnd(bytes_[at_])) ++at_;
    if (!StepOverLineEnd()) return false;
  }
  if (at_ == bytes_.size()) return false;
  ++line_;
  within_line_ = true;
  return true;
}

void TextScanner::SkipBlanks() {
  while (at_ < bytes_.size()) {
    if (IsBlank(bytes_[at_])) {
      ++at_;
    } else if (style_.continues_lines && bytes_[at_] == '\\' &&
               at_ + 1 < bytes_.size() && IsLineEnd(bytes_[at_ + 1])) {
      ++at_;
      StepOverLineEnd();
      ++line_;
    } else {
      return;
    }
  }
}

absl::string_view TextScanner::Word() {
  SkipBlanks();
  if (at_ < bytes_.size() && style_.comment != 0 &&
      bytes_[at_] == style_.comment) {
    while (at_ < bytes_.size() && !IsLineEnd(bytes_[at_])) ++at_;
  }
  const size_t begin = at_;
  while (at_ < bytes_.size() && !IsBlank(bytes_[at_]) &&
         !IsLineEnd(bytes_[at_])) {
    const bool continues = style_.continues_lines && bytes_[at_] == '\\' &&
                           at_ + 1 < bytes_.size() &&
                           IsLineEnd(bytes_[at_ + 1]);
    if (continues) break;
    ++at_;
  }
  return bytes_.substr(begin, at_ - begin);
}

absl::string_view TextScanner::WordAcrossLines() {
  if (!within_line_ && !NextLine()) return {};
  absl::string_view word = Word();
  while (word.empty() && NextLine()) word = Word();
  return word;
}

absl::StatusOr<double> TextScanner::Number(absl::string_view word,
                                           absl::string_view what) const {
  if (word.empty()) return Error(absl::StrCat("a ", what, " is missing"));
  absl::string_view digits = word;
  if (digits[0] == '+') digits.remove_prefix(1);
  double value = 0;
  const absl::from_chars_result result =
      absl::from_chars(digits.data(), digits.data() + digits.size(), value);
  const bool is_number = result.ptr == digits.data() + digits.size() &&
                         result.ec != std::errc::invalid_argument &&
                         !(word[0] == '+' && digits[0] == '-') &&
                         word.size() <= kMaxNumberLength;
  if (!is_number) {
    return Error(absl::StrCat(Quoted(word), " is no number (a ", what,
                              " was expected)"));
  }
  // Out of range leaves the nearest value: 0 or a subnormal, or the largest.
  const bool overflow =
      result.ec == std::errc::result_out_of_range && std::abs(value) > 1;
  if (overflow || !std::isfinite(value)) {
    return Error(absl::StrCat(what, " ", Quoted(word), " is not finite"));
  }
  return value;
}

absl::Status TextScanner::ReadPosition(absl::string_view x, ParsedMesh& mesh) {
  const auto row = static_cast<uint32_t>(mesh.coordinates.size() / 3);
  for (uint8_t axis = 0; axis < 3; ++axis) {
    const absl::string_view word = axis == 0 ? x : Word();
    DEFORM_ASSIGN_OR_RETURN(const double value, Number(word, "coordinate"));
    mesh.coordinates.push_back(value);
    mesh.slots.push_back({.offset = OffsetOf(word),
                          .row = row,
                          .length = static_cast<uint16_t>(word.size()),
                          .axis = axis,
                          .encoding = NumberEncoding::kText});
  }
  return absl::OkStatus();
}

std::optional<int64_t> ParseInteger(absl::string_view word) {
  int64_t value = 0;
  if (!absl::SimpleAtoi(word, &value)) return std::nullopt;
  return value;
}

}  // namespace deform
