// Who may include whom. CMake cannot hold this: Debian's headers all lie in the
// default include path.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <string>
#include <vector>

namespace deform {
namespace {

namespace fs = std::filesystem;

struct Include {
  std::string file;  // Relative to the source tree.
  std::string target;
};

std::vector<Include> AllIncludes() {
  const std::regex pattern(R"(^\s*#\s*include\s*[<"]([^>"]+)[>"])");
  std::vector<Include> includes;
  for (const char* top : {"core", "server", "client"}) {
    for (const auto& entry :
         fs::recursive_directory_iterator(fs::path(DEFORM_SOURCE_DIR) / top)) {
      const std::string extension = entry.path().extension();
      if (extension != ".cc" && extension != ".h") continue;
      std::ifstream stream(entry.path());
      std::smatch match;
      for (std::string line; std::getline(stream, line);) {
        if (!std::regex_search(line, match, pattern)) continue;
        includes.push_back(
            {fs::relative(entry.path(), DEFORM_SOURCE_DIR).string(), match[1]});
      }
    }
  }
  return includes;
}

bool Within(const std::string& path, const std::string& folder) {
  return path.rfind(folder + "/", 0) == 0;
}

// The room of a path: "core/mesh", "server/rpc", "client/cpp".
std::string RoomOf(const std::string& path) {
  const size_t first = path.find('/');
  const size_t second = path.find('/', first + 1);
  return path.substr(0, second == std::string::npos ? first : second);
}

// Each room of core, and the rooms of core it may know besides itself.
const std::map<std::string, std::vector<std::string>>& CoreArrows() {
  static const auto& arrows =
      *new std::map<std::string, std::vector<std::string>>{
          {"core/base", {}},
          {"core/mesh", {"core/base"}},
          {"core/files", {"core/base", "core/mesh"}},
          {"core/kernels", {"core/base"}},
          {"core/weights", {"core/base", "core/mesh", "core/kernels"}},
          {"core/deform",
           {"core/base", "core/mesh", "core/kernels", "core/weights"}},
          {"core/quality",
           {"core/base", "core/mesh", "core/weights", "core/deform"}},
          {"core/frames",
           {"core/base", "core/mesh", "core/kernels", "core/weights",
            "core/deform"}},
      };
  return arrows;
}

TEST(Layering, ReadsTheSources) { EXPECT_GT(AllIncludes().size(), 100u); }

TEST(Layering, CoreRoomsKnowOnlyTheRoomsBelow) {
  for (const auto& [file, target] : AllIncludes()) {
    if (!Within(file, "core") || !Within(target, "core")) continue;
    const std::string from = RoomOf(file);
    ASSERT_TRUE(CoreArrows().contains(from)) << "no arrows drawn for " << from;
    if (RoomOf(target) == from) continue;
    EXPECT_THAT(CoreArrows().at(from), testing::Contains(RoomOf(target)))
        << file << " includes " << target;
  }
}

TEST(Layering, CoreKnowsNeitherServerNorClientNorTheWire) {
  const std::regex foreign(
      R"(^(server|client|deform/v1|google|grpc|grpcpp)/|\.pb\.h$)");
  for (const auto& [file, target] : AllIncludes()) {
    if (!Within(file, "core")) continue;
    EXPECT_FALSE(std::regex_search(target, foreign))
        << file << " includes " << target;
  }
}

TEST(Layering, OnlyTheServersRpcRoomKnowsTheWire) {
  const std::regex wire(R"(^(deform/v1|google|grpc|grpcpp)/|\.pb\.h$)");
  for (const auto& [file, target] : AllIncludes()) {
    if (!Within(file, "server") || Within(file, "server/rpc")) continue;
    EXPECT_FALSE(std::regex_search(target, wire))
        << file << " includes " << target;
  }
}

// Each room of the server, and the rooms of the server it may know besides
// itself. server.cc and main.cc, which join them, know all.
const std::map<std::string, std::vector<std::string>>& ServerArrows() {
  static const auto& arrows =
      *new std::map<std::string, std::vector<std::string>>{
          {"server/stores", {}},
          {"server/models", {"server/stores"}},
          {"server/sessions", {"server/stores", "server/models"}},
          {"server/rpc", {"server/stores", "server/models", "server/sessions"}},
      };
  return arrows;
}

TEST(Layering, ServerRoomsKnowOnlyTheRoomsBelow) {
  int rooms = 0;
  for (const auto& [file, target] : AllIncludes()) {
    const auto arrows = ServerArrows().find(RoomOf(file));
    if (arrows == ServerArrows().end() || !Within(target, "server")) continue;
    ++rooms;
    if (RoomOf(target) == arrows->first) continue;
    EXPECT_THAT(arrows->second, testing::Contains(RoomOf(target)))
        << file << " includes " << target;
  }
  EXPECT_GT(rooms, 50);
}

TEST(Layering, OnlyTheSqliteWrapperKnowsSqlite) {
  for (const auto& [file, target] : AllIncludes()) {
    if (target != "sqlite3.h") continue;
    EXPECT_EQ(file, "server/stores/sqlite.cc");
  }
}

TEST(Layering, ServerAndClientDoNotKnowEachOther) {
  for (const auto& [file, target] : AllIncludes()) {
    EXPECT_FALSE(Within(file, "server") && Within(target, "client"))
        << file << " includes " << target;
    EXPECT_FALSE(Within(file, "client") && Within(target, "server"))
        << file << " includes " << target;
  }
}

TEST(Layering, OnlyTopologyKnowsOpenMesh) {
  for (const auto& [file, target] : AllIncludes()) {
    if (!Within(target, "OpenMesh")) continue;
    EXPECT_EQ(file, "core/mesh/topology.cc") << "includes " << target;
  }
}

TEST(Layering, KernelsAreFreeOfEigen) {
  for (const auto& [file, target] : AllIncludes()) {
    if (!Within(file, "core/kernels")) continue;
    EXPECT_FALSE(Within(target, "Eigen")) << file << " includes " << target;
  }
}

}  // namespace
}  // namespace deform
