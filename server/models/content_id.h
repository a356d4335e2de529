// Names that follow from content: equal content, equal name.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "absl/strings/string_view.h"
#include "core/mesh/mesh.h"
#include "core/mesh/types.h"

struct evp_md_ctx_st;

namespace deform::server {

// SHA-256 over a sequence of values. Every value goes in with its length, so
// that different sequences never run together.
class ContentHash {
 public:
  // `kind` separates hashes of different things.
  explicit ContentHash(absl::string_view kind);
  ~ContentHash();
  ContentHash(const ContentHash&) = delete;
  ContentHash& operator=(const ContentHash&) = delete;

  ContentHash& Add(absl::string_view text);
  ContentHash& Add(int64_t number);
  ContentHash& Add(double number);
  ContentHash& Add(const Positions& positions);
  ContentHash& Add(const Faces& faces);
  ContentHash& Add(std::span<const int32_t> numbers);
  ContentHash& Add(std::span<const int64_t> numbers);
  ContentHash& Add(std::span<const double> numbers);
  // One value in parts, however it is cut.
  ContentHash& AddParts(std::span<const std::span<const std::byte>> parts);

  // The first 160 bits as 40 hexadecimal digits: no two contents share them by
  // chance or by effort. Ends the sequence.
  std::string Finish();

 private:
  void AddBytes(const void* data, size_t size);

  evp_md_ctx_st* const context_;
};

}  // namespace deform::server
