#include "server/models/binding_bytes.h"

#include <limits>
#include <type_traits>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/stores/bytes.h"

namespace deform::server {
namespace {

constexpr uint64_t kVersion = 1;  // Of both.

enum class RigTag : uint64_t { kCage = 0, kHandles = 1 };

absl::Status NotSuchBytes(absl::string_view what, absl::string_view how) {
  return MakeError(absl::StatusCode::kDataLoss,
                   absl::StrCat("the stored ", what, " cannot be read: ", how),
                   {.reason = "BINDING_DAMAGED", .resource_type = "binding"});
}

template <typename Number>
void AddAll(const std::vector<Number>& numbers, ByteWriter& writer) {
  writer.Add(uint64_t{numbers.size()});
  writer.AddRaw(numbers.data(), numbers.size() * sizeof(Number));
}

// `count` numbers; none, and not ok, if there are not so many.
template <typename Number>
std::vector<Number> ReadNumbers(uint64_t count, ByteReader& reader) {
  const bool fits = count <= reader.left() / sizeof(Number);
  const auto raw = reader.Raw(fits ? count * sizeof(Number)
                                   : std::numeric_limits<uint64_t>::max());
  std::vector<Number> numbers(raw.size() / sizeof(Number));
  if (!raw.empty()) std::memcpy(numbers.data(), raw.data(), raw.size());
  return numbers;
}

template <typename Number>
void ReadAll(ByteReader& reader, std::vector<Number>& numbers) {
  numbers = ReadNumbers<Number>(reader.U64(), reader);
}

template <typename Matrix>
void AddRows(const Matrix& matrix, ByteWriter& writer) {
  writer.Add(static_cast<uint64_t>(matrix.rows()));
  writer.AddRaw(matrix.data(), static_cast<size_t>(matrix.size()) *
                                   sizeof(typename Matrix::Scalar));
}

template <typename Matrix>
Matrix ReadRows(int64_t columns, ByteReader& reader) {
  using Number = typename Matrix::Scalar;
  const uint64_t rows = reader.U64();
  const bool fits = rows <= reader.left();
  const std::vector<Number> numbers = ReadNumbers<Number>(
      fits ? rows * static_cast<uint64_t>(columns) : rows, reader);
  return Eigen::Map<const Matrix>(
      numbers.data(), static_cast<int64_t>(numbers.size()) / columns, columns);
}

void AddRig(const Rig& rig, ByteWriter& writer) {
  if (const Cage* cage = std::get_if<Cage>(&rig)) {
    writer.Add(static_cast<uint64_t>(RigTag::kCage));
    writer.Add(static_cast<uint64_t>(cage->dimension()));
    AddRows(cage->vertices(), writer);
    AddRows(cage->faces(), writer);
    return;
  }
  const auto& handles = std::get<Handles>(rig);
  const Positions free = handles.positions().topRows(handles.free_count());
  const Positions fixed = handles.positions().bottomRows(handles.fixed_count());
  writer.Add(static_cast<uint64_t>(RigTag::kHandles));
  writer.Add(static_cast<uint64_t>(handles.dimension()));
  AddRows(free, writer);
  AddRows(fixed, writer);
}

absl::StatusOr<Rig> ReadRig(ByteReader& reader) {
  const auto tag = static_cast<RigTag>(reader.U64());
  const uint64_t dimension = reader.U64();
  if (dimension != 2 && dimension != 3) {
    return NotSuchBytes("rig", "it has no dimension");
  }
  const int d = static_cast<int>(dimension);
  Positions first = ReadRows<Positions>(3, reader);
  if (tag == RigTag::kCage) {
    Faces faces = ReadRows<Faces>(d, reader);
    if (!reader.ok()) return NotSuchBytes("cage", "it is cut");
    DEFORM_ASSIGN_OR_RETURN(
        Cage cage, Cage::Create(d, std::move(first), std::move(faces)));
    return Rig(std::move(cage));
  }
  const Positions fixed = ReadRows<Positions>(3, reader);
  if (!reader.ok()) return NotSuchBytes("handles", "they are cut");
  DEFORM_ASSIGN_OR_RETURN(Handles handles,
                          Handles::Create(d, std::move(first), fixed));
  return Rig(std::move(handles));
}

// The figures in the order in which they stand in the bytes.
template <typename Quality, typename Visitor>
void VisitQuality(Quality& q, Visitor&& visit) {
  visit(q.reproduction_error);
  visit(q.partition_error);
  visit(q.weight_min);
  visit(q.weight_max);
  visit(q.weight_sum_max);
  visit(q.iterations_total);
  visit(q.iterations_max);
  visit(q.iterations_mean);
  visit(q.residual_max);
  visit(q.residual_mean);
}

struct AddFigure {
  ByteWriter& writer;
  void operator()(double figure) const { writer.Add(figure); }
  void operator()(int64_t figure) const {
    writer.Add(static_cast<uint64_t>(figure));
  }
  void operator()(int figure) const { (*this)(int64_t{figure}); }
};

struct ReadFigure {
  ByteReader& reader;
  void operator()(double& figure) const { figure = reader.Double(); }
  template <typename Integer>
  void operator()(Integer& figure) const {
    figure = static_cast<Integer>(reader.U64());
  }
};

void ReadExitPart(ByteReader& reader, ExitPart& part) {
  part.exit_face = static_cast<int32_t>(reader.U64());
  ReadAll(reader, part.points);
  ReadAll(reader, part.crossed_faces);
}

void ReadUnbound(ByteReader& reader, UnboundPoints& unbound) {
  unbound.reason = reader.String();
  unbound.detail = reader.String();
  ReadAll(reader, unbound.points);
}

// `read` fills one; as many as the bytes say and have.
template <typename Item, typename Read>
void ReadList(ByteReader& reader, std::vector<Item>& items, Read read) {
  const uint64_t count = reader.U64();
  for (uint64_t i = 0; i < count && reader.ok(); ++i) {
    read(reader, items.emplace_back());
  }
}

}  // namespace

std::string EncodeRequest(const BindRequest& request, double weight_tolerance) {
  ByteWriter writer;
  writer.Add(kVersion);
  AddRig(request.rig, writer);
  writer.Add(request.scheme);
  AddAll(request.options.handle_weights, writer);
  writer.Add(request.options.lambda);
  writer.Add(static_cast<uint64_t>(request.exits.kind));
  AddAll(request.exits.faces, writer);
  AddAll(request.exits.face_of_point, writer);
  writer.Add(static_cast<uint64_t>(request.unbindable));
  AddAll(request.clamped, writer);
  writer.Add(weight_tolerance);
  return writer.Take();
}

absl::StatusOr<DecodedRequest> DecodeRequest(
    std::span<const std::byte> bytes, std::shared_ptr<const Mesh> model) {
  ByteReader reader(bytes);
  if (reader.U64() != kVersion) {
    return NotSuchBytes("request", "another version wrote it");
  }
  absl::StatusOr<Rig> rig = ReadRig(reader);
  if (!rig.ok()) return NotSuchBytes("request", rig.status().message());
  DecodedRequest decoded{
      .request = {.model = std::move(model), .rig = *std::move(rig)}};
  BindRequest& request = decoded.request;
  request.scheme = reader.String();
  ReadAll(reader, request.options.handle_weights);
  request.options.lambda = reader.Double();
  request.exits.kind = static_cast<ExitRegions::Kind>(reader.U64());
  ReadAll(reader, request.exits.faces);
  ReadAll(reader, request.exits.face_of_point);
  request.unbindable = static_cast<Unbindable>(reader.U64());
  ReadAll(reader, request.clamped);
  decoded.weight_tolerance = reader.Double();
  if (!reader.done()) return NotSuchBytes("request", "it is cut");
  return decoded;
}

std::string EncodeFacts(const BindingFacts& facts) {
  ByteWriter writer;
  writer.Add(kVersion);
  writer.Add(static_cast<uint64_t>(facts.column_count()));
  writer.Add(uint64_t{facts.exit_parts().size()});
  for (const ExitPart& part : facts.exit_parts()) {
    writer.Add(static_cast<uint64_t>(part.exit_face));
    AddAll(part.points, writer);
    AddAll(part.crossed_faces, writer);
  }
  writer.Add(uint64_t{facts.unbound().size()});
  for (const UnboundPoints& unbound : facts.unbound()) {
    writer.Add(unbound.reason).Add(unbound.detail);
    AddAll(unbound.points, writer);
  }
  writer.Add(uint64_t{facts.warnings().size()});
  for (const std::string& warning : facts.warnings()) writer.Add(warning);
  VisitQuality(facts.quality(), AddFigure{writer});
  writer.Add(facts.compute_seconds());
  return writer.Take();
}

absl::StatusOr<BindingFacts> DecodeFacts(std::span<const std::byte> bytes,
                                         BindRequest request) {
  const auto scheme = FindScheme(request.scheme);
  if (!scheme.ok()) return NotSuchBytes("facts", scheme.status().message());
  BindingFacts::Parts parts{.request = std::move(request), .scheme = *scheme};
  ByteReader reader(bytes);
  if (reader.U64() != kVersion) {
    return NotSuchBytes("facts", "another version wrote them");
  }
  parts.columns = static_cast<int64_t>(reader.U64());
  ReadList(reader, parts.exit_parts, ReadExitPart);
  ReadList(reader, parts.unbound, ReadUnbound);
  ReadList(reader, parts.warnings,
           [](ByteReader& r, std::string& warning) { warning = r.String(); });
  VisitQuality(parts.quality, ReadFigure{reader});
  parts.compute_seconds = reader.Double();
  if (!reader.done()) return NotSuchBytes("facts", "they are cut");
  return BindingFacts(std::move(parts));
}

}  // namespace deform::server
