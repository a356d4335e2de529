#include "server/sessions/model_tables.h"

namespace deform::server {

template <typename Table, typename Make>
std::shared_ptr<const Table> ModelTables::Find(
    Entries<Table>& entries, const std::shared_ptr<const Mesh>& model,
    Make make) {
  std::erase_if(entries, [](const auto& entry) {
    return entry.second.table.expired() || entry.second.model.expired();
  });
  Entry<Table>& entry = entries[model.get()];
  auto table = entry.table.lock();
  if (table == nullptr) {
    table = make();
    entry = {model, table};
  }
  return table;
}

std::shared_ptr<const PointOrder> ModelTables::OrderOf(
    const std::shared_ptr<const Mesh>& model) {
  MutexLock lock(mutex_);
  return Find(orders_, model, [&] {
    return std::make_shared<const PointOrder>(model->positions());
  });
}

std::shared_ptr<const VertexFans> ModelTables::FansOf(
    const std::shared_ptr<const Mesh>& model) {
  MutexLock lock(mutex_);
  return Find(fans_, model, [&] {
    return std::make_shared<const VertexFans>(model->faces(), model->size());
  });
}

}  // namespace deform::server
