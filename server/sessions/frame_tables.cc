#include "server/sessions/frame_tables.h"

#include <utility>

#include "server/models/content_id.h"

namespace deform::server {

template <typename Source, typename Table>
template <typename Make>
std::shared_ptr<const Table> FrameTables::Kind<Source, Table>::Find(
    const std::shared_ptr<const Source>& of, Make make) {
  MutexLock lock(mutex_);
  std::erase_if(entries_, [](const auto& entry) {
    return entry.second.table.expired() || entry.second.of.expired();
  });
  Entry& entry = entries_[of.get()];
  auto table = entry.table.lock();
  if (table == nullptr) {
    table = make();
    entry = {of, table};
  }
  return table;
}

std::shared_ptr<const PointOrder> FrameTables::OrderOf(
    const std::shared_ptr<const Mesh>& model) {
  return orders_.Find(model, [&] {
    return std::make_shared<const PointOrder>(model->positions());
  });
}

std::shared_ptr<const VertexFans> FrameTables::FansOf(
    const std::shared_ptr<const Mesh>& model) {
  return fans_.Find(model, [&] {
    return std::make_shared<const VertexFans>(model->faces(), model->size());
  });
}

std::shared_ptr<const NamedBasis> FrameTables::BasisOf(
    const std::shared_ptr<const Binding>& binding) {
  if (binding->compressed() == nullptr) return nullptr;
  return bases_.Find(binding, [&] {
    auto basis = LeafBasis::Of(binding);
    std::string id = ContentHash("leaf basis")
                         .AddParts(basis->Pieces(basis->byte_count()))
                         .Finish();
    return std::make_shared<const NamedBasis>(
        NamedBasis{std::move(id), std::move(basis)});
  });
}

}  // namespace deform::server
