#include "server/stores/row_bytes.h"

#include "server/stores/bytes.h"

namespace deform::server {
namespace {

ByteWriter Begin(const StoreKey& key) {
  ByteWriter writer;
  writer.Add(key.tenant).Add(key.id);
  return writer;
}

void AddTime(absl::Time time, ByteWriter& writer) {
  writer.Add(static_cast<uint64_t>(absl::ToUnixMicros(time)));
}

absl::Time TakeTime(ByteReader& reader) {
  return absl::FromUnixMicros(static_cast<int64_t>(reader.U64()));
}

StoreKey TakeKey(ByteReader& reader) {
  std::string tenant = reader.String();
  std::string id = reader.String();
  return {std::move(tenant), std::move(id)};
}

template <typename Row>
std::optional<Row> IfRight(const ByteReader& reader, const StoreKey& key,
                           Row row) {
  if (!reader.done() || row.key != key) return std::nullopt;
  return row;
}

}  // namespace

std::string Encode(const StoredModel& model) {
  ByteWriter writer = Begin(model.key);
  writer.Add(model.display_name);
  AddTime(model.create_time, writer);
  return writer.Seal();
}

std::optional<StoredModel> DecodeModel(const StoreKey& key,
                                       std::span<const std::byte> bytes) {
  ByteReader reader = ByteReader::Unseal(bytes);
  StoredModel model{.key = TakeKey(reader)};
  model.display_name = reader.String();
  model.create_time = TakeTime(reader);
  return IfRight(reader, key, std::move(model));
}

std::string Encode(const StoredBinding& binding) {
  ByteWriter writer = Begin(binding.key);
  writer.Add(binding.model_id);
  AddTime(binding.create_time, writer);
  writer.Add(binding.request).Add(binding.facts);
  return writer.Seal();
}

std::optional<StoredBinding> DecodeBinding(const StoreKey& key,
                                           std::span<const std::byte> bytes) {
  ByteReader reader = ByteReader::Unseal(bytes);
  StoredBinding binding{.key = TakeKey(reader)};
  binding.model_id = reader.String();
  binding.create_time = TakeTime(reader);
  binding.request = reader.String();
  binding.facts = reader.String();
  return IfRight(reader, key, std::move(binding));
}

std::string Encode(const StoredSession& session) {
  ByteWriter writer = Begin(session.key);
  writer.Add(session.binding_id).Add(session.epoch);
  writer.Add(session.resume_token_hash);
  AddTime(session.create_time, writer);
  return writer.Seal();
}

std::optional<StoredSession> DecodeSession(const StoreKey& key,
                                           std::span<const std::byte> bytes) {
  ByteReader reader = ByteReader::Unseal(bytes);
  StoredSession session{.key = TakeKey(reader)};
  session.binding_id = reader.String();
  session.epoch = reader.U64();
  session.resume_token_hash = reader.String();
  session.create_time = TakeTime(reader);
  return IfRight(reader, key, std::move(session));
}

std::string Encode(const WeightsForm& form, const StoreKey& binding) {
  ByteWriter writer = Begin(binding);
  writer.Add(form.name).Add(uint64_t{form.version});
  return writer.Seal();
}

std::optional<WeightsForm> DecodeForm(const StoreKey& binding,
                                      std::span<const std::byte> bytes) {
  ByteReader reader = ByteReader::Unseal(bytes);
  const StoreKey key = TakeKey(reader);
  WeightsForm form{.name = reader.String()};
  form.version = static_cast<uint32_t>(reader.U64());
  if (!reader.done() || key != binding) return std::nullopt;
  return form;
}

}  // namespace deform::server
