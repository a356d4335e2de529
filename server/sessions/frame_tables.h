// What frames need of a model and its weights, made once however many sessions
// pose it.
#pragma once

#include <map>
#include <memory>
#include <string>

#include "core/base/mutex.h"
#include "core/frames/leaf_basis.h"
#include "core/frames/point_order.h"
#include "core/frames/vertex_fans.h"
#include "core/mesh/mesh.h"
#include "core/weights/binding.h"

namespace deform::server {

// A leaf basis, and the name by which clients say that they have it: the hash
// of its bytes.
struct NamedBasis {
  std::string id;
  std::shared_ptr<const LeafBasis> basis;
};

// Thread-safe. A table lives as long as somebody holds it. Making one takes
// tens of milliseconds for 10^5 points, in which others wait who want one of
// the same kind, too.
class FrameTables {
 public:
  // The order in which the points go on a grid.
  std::shared_ptr<const PointOrder> OrderOf(
      const std::shared_ptr<const Mesh>& model);
  // The faces around each vertex, for normals.
  std::shared_ptr<const VertexFans> FansOf(
      const std::shared_ptr<const Mesh>& model);
  // For frames of leaf coefficients; null while the weights are dense. Keeps
  // the binding's weights in memory.
  std::shared_ptr<const NamedBasis> BasisOf(
      const std::shared_ptr<const Binding>& binding);

 private:
  // Those of one kind.
  template <typename Source, typename Table>
  class Kind {
   public:
    // What is there, or what `make` makes.
    template <typename Make>
    std::shared_ptr<const Table> Find(const std::shared_ptr<const Source>& of,
                                      Make make) ABSL_LOCKS_EXCLUDED(mutex_);

   private:
    struct Entry {
      std::weak_ptr<const Source> of;  // Another may come to lie where it was.
      std::weak_ptr<const Table> table;
    };

    Mutex mutex_;
    std::map<const Source*, Entry> entries_ ABSL_GUARDED_BY(mutex_);
  };

  Kind<Mesh, PointOrder> orders_;
  Kind<Mesh, VertexFans> fans_;
  Kind<Binding, NamedBasis> bases_;
};

}  // namespace deform::server
