// What frames need of a model, made once however many sessions pose it.
#pragma once

#include <map>
#include <memory>

#include "core/base/mutex.h"
#include "core/frames/point_order.h"
#include "core/frames/vertex_fans.h"
#include "core/mesh/mesh.h"

namespace deform::server {

// Thread-safe. A table lives as long as somebody holds it. Making one takes
// tens of milliseconds for 10^5 points, in which others wait who want one, too.
class ModelTables {
 public:
  // The order in which the points go on a grid.
  std::shared_ptr<const PointOrder> OrderOf(
      const std::shared_ptr<const Mesh>& model) ABSL_LOCKS_EXCLUDED(mutex_);
  // The faces around each vertex, for normals.
  std::shared_ptr<const VertexFans> FansOf(
      const std::shared_ptr<const Mesh>& model) ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  template <typename Table>
  struct Entry {
    std::weak_ptr<const Mesh> model;  // Another may come to lie where it was.
    std::weak_ptr<const Table> table;
  };
  template <typename Table>
  using Entries = std::map<const Mesh*, Entry<Table>>;

  // What is there, or what `make` makes.
  template <typename Table, typename Make>
  static std::shared_ptr<const Table> Find(
      Entries<Table>& entries, const std::shared_ptr<const Mesh>& model,
      Make make);

  Mutex mutex_;
  Entries<PointOrder> orders_ ABSL_GUARDED_BY(mutex_);
  Entries<VertexFans> fans_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace deform::server
