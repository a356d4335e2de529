#include "server/stores/array_file.h"

#include <algorithm>
#include <cstring>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/stores/bytes.h"
#include "server/stores/files.h"

namespace deform::server {
namespace {

constexpr int64_t kAlignment = 64;
constexpr int64_t kBlockBytes = int64_t{1} << 20;
constexpr uint64_t kVersion = 1;
constexpr absl::string_view kMagic = "deform\r\n";
constexpr int64_t kTrailerBytes = 32;

int64_t Aligned(int64_t size) {
  return (size + kAlignment - 1) / kAlignment * kAlignment;
}

struct Place {
  std::string name;
  int64_t offset = 0;
  int64_t size = 0;
};

struct Table {
  std::string address;
  int64_t body = 0;
  std::vector<Place> places;
  std::vector<uint64_t> checksums;  // One a block.
};

int64_t BlocksOf(int64_t body) {
  return (body + kBlockBytes - 1) / kBlockBytes;
}

Table Lay(absl::string_view address, const StoredArrays& arrays) {
  Table table{.address = std::string(address)};
  for (const StoredArrays::Array& array : arrays.arrays) {
    const int64_t size = static_cast<int64_t>(array.bytes.size());
    table.places.push_back({array.name, table.body, size});
    table.body = Aligned(table.body + size);
  }
  return table;
}

// The bytes [begin, begin + block.size()) of the body.
void Assemble(const Table& table, const StoredArrays& arrays, int64_t begin,
              std::span<std::byte> block) {
  std::fill(block.begin(), block.end(), std::byte{0});
  const int64_t end = begin + static_cast<int64_t>(block.size());
  for (size_t i = 0; i < table.places.size(); ++i) {
    const Place& place = table.places[i];
    const int64_t from = std::max(begin, place.offset);
    const int64_t to = std::min(end, place.offset + place.size);
    if (from >= to) continue;
    std::memcpy(block.data() + (from - begin),
                arrays.arrays[i].bytes.data() + (from - place.offset),
                static_cast<size_t>(to - from));
  }
}

std::string Encode(const Table& table) {
  ByteWriter writer;
  writer.Add(table.address)
      .Add(static_cast<uint64_t>(table.body))
      .Add(uint64_t{table.places.size()});
  for (const Place& place : table.places) {
    writer.Add(place.name)
        .Add(static_cast<uint64_t>(place.offset))
        .Add(static_cast<uint64_t>(place.size));
  }
  for (const uint64_t checksum : table.checksums) writer.Add(checksum);
  std::string bytes = writer.Seal();
  const uint64_t size = bytes.size();
  ByteWriter trailer;
  trailer.Add(size).Add(kVersion).AddRaw(kMagic.data(), kMagic.size());
  return bytes + trailer.Seal();
}

// Only sound tables come here: their seal held.
absl::StatusOr<Table> Decode(const std::string& path,
                             std::span<const std::byte> bytes, int64_t body) {
  ByteReader reader = ByteReader::Unseal(bytes);
  if (!reader.ok())
    return FileDamaged(path, "the table is not what was written");
  Table table{.address = reader.String()};
  table.body = static_cast<int64_t>(reader.U64());
  const uint64_t count = reader.U64();
  for (uint64_t i = 0; i < count && reader.ok(); ++i) {
    Place& place = table.places.emplace_back();
    place.name = reader.String();
    place.offset = static_cast<int64_t>(reader.U64());
    place.size = static_cast<int64_t>(reader.U64());
    if (place.offset < 0 || place.size < 0 || place.offset > body ||
        place.size > body - place.offset) {
      return FileDamaged(path, "an array lies beyond the end");
    }
  }
  while (reader.ok() && reader.left() > 0) {
    table.checksums.push_back(reader.U64());
  }
  if (!reader.done() || table.body != body ||
      static_cast<int64_t>(table.checksums.size()) != BlocksOf(body)) {
    return FileDamaged(path, "the table does not fit the file");
  }
  return table;
}

absl::StatusOr<Table> ReadTable(const File& file, int64_t size) {
  if (size < kTrailerBytes) return FileDamaged(file.path(), "it is too short");
  std::byte bytes[kTrailerBytes];
  DEFORM_RETURN_IF_ERROR(file.ReadAt(size - kTrailerBytes, bytes));
  ByteReader trailer = ByteReader::Unseal(bytes);
  const uint64_t table_size = trailer.U64();
  const uint64_t version = trailer.U64();
  if (!trailer.ok() ||
      table_size > static_cast<uint64_t>(size - kTrailerBytes)) {
    return FileDamaged(file.path(), "it does not end as it was written");
  }
  if (version > kVersion) {
    return MakeError(absl::StatusCode::kFailedPrecondition,
                     absl::StrCat(file.path(), " has format ", version,
                                  "; this version of deformd knows ", kVersion),
                     {.reason = "FORMAT_TOO_NEW", .field = "data-dir"});
  }
  const int64_t body = size - kTrailerBytes - static_cast<int64_t>(table_size);
  std::vector<std::byte> table(table_size);
  DEFORM_RETURN_IF_ERROR(file.ReadAt(body, table));
  return Decode(file.path(), table, body);
}

absl::Status VerifyBody(const File& file, const Table& table) {
  std::vector<std::byte> buffer(
      static_cast<size_t>(std::min(table.body, kBlockBytes)));
  for (int64_t begin = 0; begin < table.body; begin += kBlockBytes) {
    const std::span<std::byte> block(
        buffer.data(),
        static_cast<size_t>(std::min(table.body - begin, kBlockBytes)));
    DEFORM_RETURN_IF_ERROR(file.ReadAt(begin, block));
    const int64_t number = begin / kBlockBytes;
    if (Checksum(block) != table.checksums[static_cast<size_t>(number)]) {
      return FileDamaged(file.path(), absl::StrCat("MiB ", number,
                                                   " is not what was written"));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status WriteArrayFile(FileSystem& files, const std::string& path,
                            absl::string_view address,
                            const StoredArrays& arrays) {
  DEFORM_ASSIGN_OR_RETURN(File file,
                          File::Open(files, path, FileSystem::Access::kCreate));
  Table table = Lay(address, arrays);
  std::vector<std::byte> buffer(
      static_cast<size_t>(std::min(table.body, kBlockBytes)));
  for (int64_t begin = 0; begin < table.body; begin += kBlockBytes) {
    const std::span<std::byte> block(
        buffer.data(),
        static_cast<size_t>(std::min(table.body - begin, kBlockBytes)));
    Assemble(table, arrays, begin, block);
    table.checksums.push_back(Checksum(block));
    DEFORM_RETURN_IF_ERROR(file.WriteAt(begin, block));
  }
  DEFORM_RETURN_IF_ERROR(file.WriteAt(table.body, AsBytes(Encode(table))));
  return file.Sync();
}

absl::StatusOr<StoredArrays> ReadArrayFile(FileSystem& files,
                                           const std::string& path,
                                           absl::string_view address) {
  DEFORM_ASSIGN_OR_RETURN(const File file,
                          File::Open(files, path, FileSystem::Access::kRead));
  DEFORM_ASSIGN_OR_RETURN(const int64_t size, file.Size());
  DEFORM_ASSIGN_OR_RETURN(const Table table, ReadTable(file, size));
  if (table.address != address) {
    return FileDamaged(path, absl::StrCat("it holds ", table.address));
  }
  DEFORM_RETURN_IF_ERROR(VerifyBody(file, table));
  DEFORM_ASSIGN_OR_RETURN(auto mapping, file.Map(size));
  StoredArrays arrays;
  for (const Place& place : table.places) {
    arrays.arrays.push_back(
        {place.name,
         {mapping.get() + place.offset, static_cast<size_t>(place.size)}});
  }
  arrays.owner = std::move(mapping);
  return arrays;
}

}  // namespace deform::server
