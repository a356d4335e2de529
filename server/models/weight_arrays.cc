// Arrays of the dense form: tiles, solutions. Of the compressed one: structure,
// slots, solutions; then, without names, in the order of the structure, the
// basis of each cluster, and basis, leaf rows and numbers of each branch.
#include "server/models/weight_arrays.h"

#include <cstring>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "server/stores/bytes.h"

namespace deform::server {
namespace {

constexpr char kDense[] = "dense";
constexpr char kCompressed[] = "compressed";
constexpr uint32_t kVersion = 1;  // Of both.
constexpr size_t kNamedArrays = 3;

using Cluster = CompressedWeights::Cluster;
using Branch = CompressedWeights::Branch;
using Leaf = CompressedWeights::Leaf;

template <typename Number>
StoredArrays::Array ArrayOf(const char* name, const Number* numbers,
                            int64_t count) {
  return {name, std::as_bytes(std::span(numbers, static_cast<size_t>(count)))};
}

StoredArrays::Array ArrayOf(const WeightTiles& tiles) {
  return ArrayOf("", tiles.tile(0), tiles.bytes() / int64_t{sizeof(float)});
}

uint64_t U(int64_t number) { return static_cast<uint64_t>(number); }

std::string StructureOf(const CompressedWeights::Parts& parts) {
  ByteWriter writer;
  writer.Add(U(parts.columns)).Add(parts.tolerance).Add(parts.bound);
  writer.Add(uint64_t{parts.clusters.size()});
  for (const Cluster& cluster : parts.clusters) {
    writer.Add(U(cluster.basis.points())).Add(U(cluster.first_top));
  }
  writer.Add(uint64_t{parts.branches.size()});
  for (const Branch& branch : parts.branches) {
    writer.Add(U(branch.cluster)).Add(U(branch.basis.points()));
    writer.Add(U(branch.basis.columns())).Add(U(branch.leaf_rows.points()));
    writer.Add(U(branch.leaf_rows.columns())).Add(U(branch.numbers.size()));
    writer.Add(uint64_t{branch.leaves.size()});
    for (const Leaf& leaf : branch.leaves) {
      writer.Add(U(leaf.first_slot)).Add(U(leaf.blocks));
      writer.Add(U(leaf.columns.floats)).Add(U(leaf.columns.shorts));
      writer.Add(U(leaf.columns.bytes)).Add(leaf.step);
      writer.Add(U(leaf.first_row)).Add(U(leaf.first_byte));
    }
  }
  return writer.Take();
}

// Reads arrays in order. Whatever does not fit reads as nothing, and ok() is
// false from then on.
class Borrower {
 public:
  explicit Borrower(const StoredArrays& arrays)
      : arrays_(arrays), next_(kNamedArrays) {}

  WeightTiles Tiles(int64_t points, int64_t columns) {
    const auto bytes = Next(WeightTiles::BytesFor(points, columns));
    if (!ok_) return {};
    return WeightTiles::Borrow(points, columns,
                               reinterpret_cast<const float*>(bytes.data()),
                               arrays_.owner);
  }
  ZeroedArray<std::byte> Numbers(int64_t size) {
    const auto bytes = Next(size);
    if (!ok_) return {};
    return ZeroedArray<std::byte>::Borrow(bytes.data(), size, arrays_.owner);
  }
  bool done() const { return ok_ && next_ == arrays_.arrays.size(); }

 private:
  std::span<const std::byte> Next(int64_t size) {
    if (next_ >= arrays_.arrays.size()) ok_ = false;
    if (!ok_) return {};
    const auto bytes = arrays_.arrays[next_++].bytes;
    ok_ = std::ssize(bytes) == size;
    return bytes;
  }

  const StoredArrays& arrays_;
  size_t next_;
  bool ok_ = true;
};

int64_t I(ByteReader& reader) { return static_cast<int64_t>(reader.U64()); }

Branch ReadBranch(ByteReader& reader, Borrower& arrays) {
  Branch branch;
  branch.cluster = I(reader);
  const int64_t points = I(reader);
  branch.basis = arrays.Tiles(points, I(reader));
  const int64_t rows = I(reader);
  branch.leaf_rows = arrays.Tiles(rows, I(reader));
  branch.numbers = arrays.Numbers(I(reader));
  const uint64_t leaves = reader.U64();
  for (uint64_t i = 0; i < leaves && reader.ok(); ++i) {
    Leaf& leaf = branch.leaves.emplace_back();
    leaf.first_slot = I(reader);
    leaf.blocks = I(reader);
    leaf.columns.floats = I(reader);
    leaf.columns.shorts = I(reader);
    leaf.columns.bytes = I(reader);
    leaf.step = reader.Double();
    leaf.first_row = I(reader);
    leaf.first_byte = I(reader);
  }
  return branch;
}

std::vector<int32_t> ReadSlots(std::span<const std::byte> bytes) {
  std::vector<int32_t> slots(bytes.size() / sizeof(int32_t));
  if (!slots.empty()) {
    std::memcpy(slots.data(), bytes.data(), slots.size() * sizeof(int32_t));
  }
  return slots;
}

// Null if the arrays do not fit together.
std::shared_ptr<const CompressedWeights> ReadCompressed(
    const StoredArrays& arrays) {
  ByteReader reader(arrays.Find("structure"));
  Borrower borrower(arrays);
  CompressedWeights::Parts parts{.columns = I(reader)};
  parts.slots = ReadSlots(arrays.Find("slots"));
  parts.tolerance = reader.Double();
  parts.bound = reader.Double();
  const uint64_t clusters = reader.U64();
  for (uint64_t i = 0; i < clusters && reader.ok(); ++i) {
    Cluster& cluster = parts.clusters.emplace_back();
    cluster.basis = borrower.Tiles(I(reader), parts.columns);
    cluster.first_top = I(reader);
  }
  const uint64_t branches = reader.U64();
  for (uint64_t i = 0; i < branches && reader.ok(); ++i) {
    parts.branches.push_back(ReadBranch(reader, borrower));
  }
  if (!reader.done() || !borrower.done()) return nullptr;
  return std::make_shared<const CompressedWeights>(std::move(parts));
}

// Null if the arrays do not fit.
std::shared_ptr<const WeightTiles> ReadDense(const BindingFacts& facts,
                                             const StoredArrays& arrays) {
  const auto bytes = arrays.Find("tiles");
  if (std::ssize(bytes) !=
      WeightTiles::BytesFor(facts.point_count(), facts.column_count())) {
    return nullptr;
  }
  return std::make_shared<const WeightTiles>(WeightTiles::Borrow(
      facts.point_count(), facts.column_count(),
      reinterpret_cast<const float*>(bytes.data()), arrays.owner));
}

// Null if there are none.
std::shared_ptr<const Solutions> ReadSolutions(
    std::span<const std::byte> bytes) {
  if (bytes.empty()) return nullptr;
  auto solutions = std::make_shared<Solutions>(
      static_cast<int64_t>(bytes.size() / (3 * sizeof(float))), 3);
  std::memcpy(solutions->data(), bytes.data(),
              static_cast<size_t>(solutions->size()) * sizeof(float));
  return solutions;
}

absl::Status NotSuchWeights() {
  return MakeError(absl::StatusCode::kDataLoss,
                   "the stored arrays are not weights of this binding",
                   {.reason = "FILE_DAMAGED", .resource_type = "file"});
}

}  // namespace

WeightsForm FormOf(const Binding& binding) {
  return {.name = binding.compressed() != nullptr ? kCompressed : kDense,
          .version = kVersion};
}

StoredArrays ArraysOf(std::shared_ptr<const Binding> binding) {
  struct Owned {
    std::shared_ptr<const Binding> binding;
    std::string structure;
  };
  auto owned = std::make_shared<Owned>();
  owned->binding = std::move(binding);
  StoredArrays stored{.owner = owned};
  const Solutions* const solutions = owned->binding->solutions().get();
  const StoredArrays::Array solved =
      solutions == nullptr
          ? StoredArrays::Array{"solutions", {}}
          : ArrayOf("solutions", solutions->data(), solutions->size());
  const CompressedWeights* const compressed = owned->binding->compressed();
  if (compressed == nullptr) {
    const WeightTiles& tiles = owned->binding->weights();
    stored.arrays = {
        ArrayOf("tiles", tiles.tile(0), tiles.bytes() / int64_t{sizeof(float)}),
        solved};
    return stored;
  }
  const CompressedWeights::Parts& parts = compressed->parts();
  owned->structure = StructureOf(parts);
  stored.arrays = {
      {"structure", AsBytes(owned->structure)},
      ArrayOf("slots", parts.slots.data(), std::ssize(parts.slots)),
      solved};
  for (const Cluster& cluster : parts.clusters) {
    stored.arrays.push_back(ArrayOf(cluster.basis));
  }
  for (const Branch& branch : parts.branches) {
    stored.arrays.push_back(ArrayOf(branch.basis));
    stored.arrays.push_back(ArrayOf(branch.leaf_rows));
    stored.arrays.push_back(
        ArrayOf("", branch.numbers.data(), branch.numbers.size()));
  }
  return stored;
}

absl::StatusOr<std::shared_ptr<const Binding>> BindingFrom(
    const BindingFacts& facts, const StoredWeights& weights) {
  const StoredArrays& arrays = weights.arrays;
  auto solutions = ReadSolutions(arrays.Find("solutions"));
  if (solutions != nullptr && solutions->rows() != facts.point_count()) {
    return NotSuchWeights();
  }
  if (weights.form.version != kVersion) return NotSuchWeights();
  if (weights.form.name == kDense) {
    auto tiles = ReadDense(facts, arrays);
    if (tiles == nullptr) return NotSuchWeights();
    return std::make_shared<const Binding>(facts, std::move(tiles),
                                           std::move(solutions));
  }
  if (weights.form.name != kCompressed) return NotSuchWeights();
  auto compressed = ReadCompressed(arrays);
  if (compressed == nullptr || compressed->points() != facts.point_count() ||
      compressed->columns() != facts.column_count()) {
    return NotSuchWeights();
  }
  return std::make_shared<const Binding>(facts, std::move(compressed),
                                         std::move(solutions));
}

}  // namespace deform::server
