#include "server/models/content_id.h"

#include <openssl/evp.h>

#include <cassert>

#include "absl/strings/escaping.h"

namespace deform::server {
namespace {

constexpr size_t kIdBytes = 20;

}  // namespace

ContentHash::ContentHash(absl::string_view kind) : context_(EVP_MD_CTX_new()) {
  [[maybe_unused]] const int ok =
      EVP_DigestInit_ex(context_, EVP_sha256(), nullptr);
  assert(ok == 1);
  Add(kind);
}

ContentHash::~ContentHash() { EVP_MD_CTX_free(context_); }

ContentHash& ContentHash::Add(absl::string_view text) {
  AddBytes(text.data(), text.size());
  return *this;
}

ContentHash& ContentHash::Add(int64_t number) {
  AddBytes(&number, sizeof(number));
  return *this;
}

ContentHash& ContentHash::Add(double number) {
  AddBytes(&number, sizeof(number));
  return *this;
}

ContentHash& ContentHash::Add(const Positions& positions) {
  AddBytes(positions.data(), positions.size() * sizeof(double));
  return *this;
}

ContentHash& ContentHash::Add(const Faces& faces) {
  AddBytes(faces.data(), faces.size() * sizeof(int32_t));
  return *this;
}

ContentHash& ContentHash::Add(std::span<const int32_t> numbers) {
  AddBytes(numbers.data(), numbers.size_bytes());
  return *this;
}

ContentHash& ContentHash::Add(std::span<const int64_t> numbers) {
  AddBytes(numbers.data(), numbers.size_bytes());
  return *this;
}

ContentHash& ContentHash::Add(std::span<const double> numbers) {
  AddBytes(numbers.data(), numbers.size_bytes());
  return *this;
}

ContentHash& ContentHash::AddParts(
    std::span<const std::span<const std::byte>> parts) {
  uint64_t length = 0;
  for (const auto& part : parts) length += part.size();
  EVP_DigestUpdate(context_, &length, sizeof(length));
  for (const auto& part : parts) {
    EVP_DigestUpdate(context_, part.data(), part.size());
  }
  return *this;
}

void ContentHash::AddBytes(const void* data, size_t size) {
  const uint64_t length = size;
  EVP_DigestUpdate(context_, &length, sizeof(length));
  if (size > 0) EVP_DigestUpdate(context_, data, size);
}

std::string ContentHash::Finish() {
  unsigned char digest[EVP_MAX_MD_SIZE];
  EVP_DigestFinal_ex(context_, digest, nullptr);
  return absl::BytesToHexString(
      absl::string_view(reinterpret_cast<const char*>(digest), kIdBytes));
}

}  // namespace deform::server
