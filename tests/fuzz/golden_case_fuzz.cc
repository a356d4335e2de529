// Reference case files: any text gives a case, nothing, or an error that names
// the file.
#include "absl/strings/match.h"
#include "client/verify/golden_case.h"
#include "core/base/error.h"
#include "tests/fuzz/expect.h"

namespace deform {
namespace {

// What the runner of a case relies on.
void CheckCase(const GoldenCase& golden) {
  FUZZ_EXPECT(golden.dimension == 2 || golden.dimension == 3);
  FUZZ_EXPECT(!golden.queries.empty());
  for (const GoldenDeformation& deformation : golden.deformations) {
    FUZZ_EXPECT(deformation.vertices.rows() == golden.rig.vertices.rows());
    FUZZ_EXPECT(deformation.stretch.empty() ||
                static_cast<int64_t>(deformation.stretch.size()) ==
                    golden.rig.faces.rows());
  }
  for (const GoldenQuery& query : golden.queries) {
    for (const auto& [index, place] : query.deformed) {
      FUZZ_EXPECT(index >= 0 &&
                  index < static_cast<int>(golden.deformations.size()));
    }
  }
}

}  // namespace
}  // namespace deform

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto golden = deform::ParseGoldenCase(
      {reinterpret_cast<const char*>(data), size}, "case.json");
  if (!golden.ok()) {
    FUZZ_EXPECT(deform::DetailOf(golden.status()).reason == "BAD_CASE");
    FUZZ_EXPECT(absl::StartsWith(golden.status().message(), "case.json: "));
  } else if (*golden) {
    deform::CheckCase(**golden);
  }
  return 0;
}
