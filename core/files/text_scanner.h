// Lines and words of a text file, with their places.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/files/mesh_format.h"

namespace deform {

// Walks over text whose lines end in \n, \r\n or \r. Borrows the bytes.
class TextScanner {
 public:
  struct Style {
    // Begins a comment up to the end of the line; 0 for none.
    char comment = 0;
    // A backslash at the end of a line joins the next one to it.
    bool continues_lines = false;
  };

  // Starts before the first line, or, with `lines` of them behind it, at
  // `begin`.
  TextScanner(absl::string_view bytes, Style style, size_t begin = 0,
              int64_t lines = 0)
      : bytes_(bytes), style_(style), at_(begin), line_(lines) {}

  // Moves to the beginning of the next line; false if there is none.
  bool NextLine();
  // The next word of this line; empty at its end.
  absl::string_view Word();
  // The next word of this line or one of the next; empty at the end.
  absl::string_view WordAcrossLines();

  // Number of the line, from 1.
  int64_t line() const { return line_; }
  // Bytes not yet walked over.
  size_t remaining() const { return bytes_.size() - at_; }
  // Where `word`, one of this text, stands.
  uint64_t OffsetOf(absl::string_view word) const {
    return word.data() - bytes_.data();
  }
  // BadLine() with the current line.
  absl::Status Error(absl::string_view what) const {
    return BadLine(line_, what);
  }

  // `word` as a finite number, exactly rounded; an error that says what it is
  // (`what`: "coordinate") otherwise.
  absl::StatusOr<double> Number(absl::string_view word,
                                absl::string_view what) const;

  // Reads `x`, a word of this line, and the next two as the position of the
  // next vertex into `mesh`, with their slots.
  absl::Status ReadPosition(absl::string_view x, ParsedMesh& mesh);

 private:
  // Steps over one line end, if there is one here.
  bool StepOverLineEnd();
  void SkipBlanks();

  absl::string_view bytes_;
  Style style_;
  size_t at_;
  int64_t line_;
  bool within_line_ = false;
};

// `word` as a whole number; nullopt if it is none or beyond 64 bits.
std::optional<int64_t> ParseInteger(absl::string_view word);

// The largest index of a file and its line or byte: indices may stand before
// what they refer to, so the check comes last.
struct LargestIndex {
  int64_t index = -1;
  int64_t place = 0;
  void See(int64_t seen, int64_t seen_at) {
    if (seen > index) {
      index = seen;
      place = seen_at;
    }
  }
};

}  // namespace deform
