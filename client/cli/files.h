// Files that commands read and write. Every error names the path and ends
// deformctl with kBadFile.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/cpp/arrays.h"
#include "core/files/mesh_file.h"

namespace deform::cli {

absl::StatusOr<MeshFile> LoadMesh(
    const std::string& path,
    FileDimension dimension = FileDimension::kAutomatic);

// What FileDimension a --dimension of 0 (automatic), 2 or 3 means.
FileDimension ToFileDimension(int dimension);

// The cage that a file holds: triangles in 3D, the loops of its polylines in
// 2D, turned so that the domain lies on their left.
absl::StatusOr<RigArrays> CageOf(const MeshFile& file, const std::string& path);

// Numbers separated by white space or commas.
absl::StatusOr<std::vector<double>> LoadNumbers(const std::string& path);

absl::Status WriteFile(const std::string& path, absl::string_view bytes);

}  // namespace deform::cli
