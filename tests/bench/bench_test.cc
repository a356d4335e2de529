// The whole program on a few points: it measures all, and tells what became
// slower.
#include <gmock/gmock.h>
#include <sys/wait.h>

#include <cstdlib>
#include <fstream>
#include <set>
#include <string>

#include <nlohmann/json.hpp>

#include "tests/support/temporary_folder.h"

namespace deform::bench {
namespace {

using Json = nlohmann::json;
using testing::Contains;
using testing::HasSubstr;

// Of the program; what it prints goes to `printed`.
int ExitCode(const std::string& arguments, std::string* printed = nullptr) {
  const std::string out = Temporary().Path("printed");
  const int status =
      std::system((std::string(DEFORM_BENCH_PROGRAM) + " --scale 0.001 " +
                   arguments + " > " + out + " 2>&1")
                      .c_str());
  if (printed != nullptr) {
    std::ifstream in(out);
    printed->assign(std::istreambuf_iterator<char>(in), {});
  }
  return WEXITSTATUS(status);
}

Json Read(const std::string& file) {
  std::ifstream in(file);
  return Json::parse(in, nullptr, false);
}

TEST(Bench, MeasuresEverythingOnce) {
  const std::string file = Temporary().Path("all.json");
  std::string printed;
  ASSERT_EQ(ExitCode("--json " + file, &printed), 0) << printed;
  std::set<std::string> names;
  const Json all = Read(file);
  for (const Json& row : all["rows"]) {
    const std::string name = row["name"];
    EXPECT_TRUE(names.insert(name).second) << name << " twice";
    EXPECT_GT(row["seconds"].get<double>(), 0) << name;
    EXPECT_THAT(printed, HasSubstr(name));
    // Compression was asked for 1e-4 at the coarsest.
    if (!row["error"].is_null()) {
      EXPECT_LE(row["error"].get<double>(), 1e-4) << name;
    }
  }
  for (const char* name :
       {"memory read/8 walks, 1 core", "weights Green 3D/[L08] Algorithm 2",
        "weights T-CC, 100 handles/lanes in double",
        "deform 173K x 326/this, dense, 1 core",
        "deform 173K x 326/this, compressed to 1e-05, 1 core",
        "deform 173K x 326/Eigen float, 1 core",
        "deform 173K x 100 handles/this, K = 8, a session, 1 core",
        "deform 1M x 44/plain loops, 1 core",
        "sessions 100 x 100 points, 44 columns/this, batched, all cores"}) {
    EXPECT_THAT(names, Contains(name));
  }
}

TEST(Bench, TellsWhatBecameSlower) {
  const std::string file = Temporary().Path("now.json");
  const std::string options = "--filter none --json " + file;
  ASSERT_EQ(ExitCode(options), 0);
  // No machine changes its speed a million times.
  const auto compare = [&](double factor, std::string* printed) {
    Json old = Read(file);
    for (Json& row : old["rows"]) {
      row["seconds"] = row["seconds"].get<double>() * factor;
    }
    const std::string path = Temporary().Write("old.json", old.dump());
    return ExitCode("--filter none --fail --compare " + path, printed);
  };
  std::string printed;
  EXPECT_EQ(compare(1e-6, &printed), 1);
  EXPECT_THAT(printed, HasSubstr("slower: memory read/1 walks, 1 core"));
  EXPECT_EQ(compare(1e6, &printed), 0);
  EXPECT_THAT(printed, Not(HasSubstr("slower:")));
}

TEST(Bench, RefusesAFileThatItDidNotWrite) {
  std::string printed;
  const std::string path = Temporary().Write("other.json", "[1, 2]");
  EXPECT_EQ(ExitCode("--filter none --compare " + path, &printed), 2);
  EXPECT_THAT(printed, HasSubstr("other.json is not what --json writes"));
}

}  // namespace
}  // namespace deform::bench
