#include "client/cli/files.h"

#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "client/cli/exit_code.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/files/loops.h"

namespace deform::cli {

absl::StatusOr<MeshFile> LoadMesh(const std::string& path,
                                  FileDimension dimension) {
  absl::StatusOr<MeshFile> file = ReadMeshFile(path, dimension);
  if (!file.ok()) return WithExit(kBadFile, file.status());
  return file;
}

FileDimension ToFileDimension(int dimension) {
  switch (dimension) {
    case 2:
      return FileDimension::k2d;
    case 3:
      return FileDimension::k3d;
    default:
      return FileDimension::kAutomatic;
  }
}

absl::StatusOr<RigArrays> CageOf(const MeshFile& file,
                                 const std::string& path) {
  if (file.dimension == 3) {
    if (file.faces.rows() == 0) {
      return WithExit(
          kBadFile,
          InvalidInput(
              "NO_CAGE", "",
              absl::StrCat(
                  path, ": has no faces: the cage of a 3D ",
                  "model is a closed mesh",
                  file.edges.rows() == 0 ? "" : "; loops are for 2D models")));
    }
    return RigArrays(RigKind::kCage, 3, file.positions, file.faces);
  }
  if (file.edges.rows() == 0) {
    return WithExit(kBadFile,
                    InvalidInput("NO_CAGE", "",
                                 absl::StrCat(path,
                                              ": has no polylines: a 2D "
                                              "cage is made of the loops "
                                              "of OBJ 'l' elements")));
  }
  absl::StatusOr<Faces> loops = OrientLoops(file.positions, file.edges);
  if (!loops.ok()) {
    return WithExit(kBadFile,
                    Annotate(loops.status(), absl::StrCat(path, ": ")));
  }
  return RigArrays(RigKind::kCage, 2, file.positions, *std::move(loops));
}

absl::StatusOr<std::vector<double>> LoadNumbers(const std::string& path) {
  const auto fail = [&](absl::string_view reason, absl::string_view what) {
    return WithExit(kBadFile,
                    InvalidInput(reason, "", absl::StrCat(path, ": ", what)));
  };
  std::ifstream stream(path, std::ios::binary);
  if (!stream) return fail("FILE_NOT_FOUND", std::strerror(errno));
  const std::string text((std::istreambuf_iterator<char>(stream)), {});
  std::vector<double> numbers;
  for (const absl::string_view word :
       absl::StrSplit(absl::string_view(text), absl::ByAnyChar(" \t\r\n,"),
                      absl::SkipEmpty())) {
    double number = 0;
    if (!absl::SimpleAtod(word, &number)) {
      return fail("BAD_NUMBER",
                  absl::StrCat("entry ", numbers.size(), " ('",
                               word.substr(0, 40), "') is not a number"));
    }
    numbers.push_back(number);
  }
  return numbers;
}

absl::Status WriteFile(const std::string& path, absl::string_view bytes) {
  std::ofstream stream(path, std::ios::binary | std::ios::trunc);
  stream.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  stream.close();
  if (stream) return absl::OkStatus();
  return WithExit(
      kBadFile,
      MakeError(
          absl::StatusCode::kPermissionDenied,
          absl::StrCat(path, ": cannot be written: ", std::strerror(errno)),
          {.reason = "FILE_NOT_WRITABLE"}));
}

}  // namespace deform::cli
