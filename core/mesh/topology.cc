#include "core/mesh/topology.h"

#include <vector>

#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <OpenMesh/Tools/Decimater/DecimaterT.hh>
#include <OpenMesh/Tools/Decimater/ModNormalFlippingT.hh>
#include <OpenMesh/Tools/Decimater/ModQuadricT.hh>

namespace deform {
namespace {

using HalfEdgeMesh =
    OpenMesh::TriMesh_ArrayKernelT<OpenMesh::DefaultTraitsDouble>;
using Allows = absl::FunctionRef<bool(const Vec3&, const Vec3&, const Vec3&)>;

Vec3 ToVec3(const HalfEdgeMesh::Point& point) {
  return {point[0], point[1], point[2]};
}

HalfEdgeMesh ToHalfEdges(const TriangleSurface& surface) {
  HalfEdgeMesh mesh;
  std::vector<HalfEdgeMesh::VertexHandle> vertices;
  for (const auto& p : surface.positions.rowwise()) {
    vertices.push_back(mesh.add_vertex({p[0], p[1], p[2]}));
  }
  for (const auto& face : surface.faces.rowwise()) {
    mesh.add_face(vertices[face[0]], vertices[face[1]], vertices[face[2]]);
  }
  return mesh;
}

TriangleSurface FromHalfEdges(const HalfEdgeMesh& mesh) {
  TriangleSurface surface{Positions(mesh.n_vertices(), 3),
                          Faces(mesh.n_faces(), 3)};
  for (const auto vertex : mesh.vertices()) {
    surface.positions.row(vertex.idx()) = ToVec3(mesh.point(vertex));
  }
  for (const auto face : mesh.faces()) {
    int k = 0;
    for (const auto vertex : face.vertices()) {
      surface.faces(face.idx(), k++) = vertex.idx();
    }
  }
  return surface;
}

// Quadric errors with a term that orders collapses where there is no error, as
// on flat parts: short edges go first, which keeps triangles even.
template <typename MeshT>
class ModEvenQuadric : public OpenMesh::Decimater::ModQuadricT<MeshT> {
 public:
  DECIMATING_MODULE(ModEvenQuadric, MeshT, EvenQuadric);
  using Quadric = OpenMesh::Decimater::ModQuadricT<MeshT>;

  explicit ModEvenQuadric(MeshT& mesh) : Quadric(mesh) {
    this->unset_max_err();
  }

  float collapse_priority(const CollapseInfo& collapse) override {
    // Quadrics are squared distances times areas: an edge's share is that of a
    // deviation by a tenth of its length.
    constexpr double kShare = 0.01;
    const double length2 = (collapse.p1 - collapse.p0).sqrnorm();
    return Quadric::collapse_priority(collapse) +
           static_cast<float>(kShare * length2 * length2);
  }
};

// Asks `allows` for the triangles of a collapse: those around the vertex that
// goes, with the one that stays in its place.
template <typename MeshT>
class ModAllows : public OpenMesh::Decimater::ModBaseT<MeshT> {
 public:
  DECIMATING_MODULE(ModAllows, MeshT, Allows);

  explicit ModAllows(MeshT& mesh) : Base(mesh, true) {}

  void set_allows(const Allows* allows) { allows_ = allows; }

  float collapse_priority(const CollapseInfo& collapse) override {
    const Vec3 kept = ToVec3(collapse.p1);
    for (const auto halfedge : Base::mesh().voh_range(collapse.v0)) {
      const auto from = halfedge.to();
      const auto to = halfedge.next().to();
      if (from == collapse.v1 || to == collapse.v1) continue;
      if (!(*allows_)(kept, ToVec3(Base::mesh().point(from)),
                      ToVec3(Base::mesh().point(to)))) {
        return Base::ILLEGAL_COLLAPSE;
      }
    }
    return Base::LEGAL_COLLAPSE;
  }

 private:
  const Allows* allows_ = nullptr;
};

}  // namespace

TriangleSurface Decimate(const TriangleSurface& surface, int64_t target_faces,
                         Allows allows) {
  HalfEdgeMesh mesh = ToHalfEdges(surface);
  mesh.request_face_normals();
  mesh.update_face_normals();
  mesh.request_vertex_status();
  mesh.request_edge_status();
  mesh.request_face_status();
  OpenMesh::Decimater::DecimaterT<HalfEdgeMesh> decimater(mesh);
  ModEvenQuadric<HalfEdgeMesh>::Handle quadric;
  OpenMesh::Decimater::ModNormalFlippingT<HalfEdgeMesh>::Handle flipping;
  ModAllows<HalfEdgeMesh>::Handle allowing;
  decimater.add(quadric);
  decimater.add(flipping);
  decimater.module(flipping).set_max_normal_deviation(60);
  decimater.add(allowing);
  decimater.module(allowing).set_allows(&allows);
  decimater.initialize();
  decimater.decimate_to_faces(0, target_faces);
  mesh.garbage_collection();
  return FromHalfEdges(mesh);
}

}  // namespace deform
