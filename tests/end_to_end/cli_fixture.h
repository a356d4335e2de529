// deformctl against a live server, with files to give it.
#pragma once

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "client/cli/exit_code.h"
#include "core/files/mesh_file.h"
#include "tests/client/cli/cli_run.h"
#include "tests/client/verify/hand_made.h"
#include "tests/end_to_end/running_server.h"
#include "tests/support/temporary_folder.h"

namespace deform::cli {

class Cli : public testing::Test {
 protected:
  Cli() {
    Write("ball.obj", ObjText(Ball().positions(), Ball().faces()));
    Write("cube.obj", ObjText(Cube().vertices(), Cube().faces()));
    Positions posed = Cube().vertices();
    posed.col(0) = posed.col(0).array() * 1 + 5;
    Write("moved.obj", ObjText(posed, Cube().faces()));
  }

  std::string Path(const std::string& name) { return folder_.Path(name); }
  std::string Write(const std::string& name, const std::string& text) {
    return folder_.Write(name, text);
  }
  std::string Read(const std::string& name) {
    std::ifstream stream(Path(name), std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }

  CliResult Run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"--server", server_.address()});
    return RunCli(arguments);
  }
  Json RunJson(std::vector<std::string> arguments) {
    arguments.push_back("--json");
    const CliResult result = Run(arguments);
    EXPECT_EQ(result.exit_code, kOk) << result.out << result.err;
    return result.json();
  }

  std::string Register() {
    return RunJson({"register", Path("ball.obj")})["model_id"];
  }
  std::string Bind() {
    return RunJson(
        {"bind", Register(), "--cage", Path("cube.obj")})["binding_id"];
  }
  bool ServerIsEmpty() {
    return server_.client().ListModels()->empty() &&
           server_.client().ListBindings()->empty() &&
           server_.client().ListSessions()->empty();
  }

  RunningServer server_;
  const TemporaryFolder folder_;
};

}  // namespace deform::cli
