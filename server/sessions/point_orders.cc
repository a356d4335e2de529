#include "server/sessions/point_orders.h"

namespace deform::server {

std::shared_ptr<const PointOrder> PointOrders::Of(
    const std::shared_ptr<const Mesh>& model) {
  MutexLock lock(mutex_);
  std::erase_if(entries_, [](const auto& entry) {
    return entry.second.order.expired() || entry.second.model.expired();
  });
  Entry& entry = entries_[model.get()];
  auto order = entry.order.lock();
  if (order == nullptr) {
    order = std::make_shared<const PointOrder>(model->positions());
    entry = {model, order};
  }
  return order;
}

}  // namespace deform::server
