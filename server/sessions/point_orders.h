// The orders in which models' points go on a grid, each kept once.
#pragma once

#include <map>
#include <memory>

#include "core/base/mutex.h"
#include "core/frames/point_order.h"
#include "core/mesh/mesh.h"

namespace deform::server {

// Thread-safe. An order lives as long as somebody holds it.
class PointOrders {
 public:
  // Sorts the points, unless that was done before: tens of milliseconds for
  // 10^5 of them, in which others wait who want one, too.
  std::shared_ptr<const PointOrder> Of(const std::shared_ptr<const Mesh>& model)
      ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  struct Entry {
    std::weak_ptr<const Mesh> model;  // Another may come to lie where it was.
    std::weak_ptr<const PointOrder> order;
  };

  Mutex mutex_;
  std::map<const Mesh*, Entry> entries_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace deform::server
