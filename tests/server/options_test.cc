#include "server/options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "core/base/error.h"
#include "tests/support/temporary_folder.h"

namespace deform::server {
namespace {

using testing::HasSubstr;

absl::StatusOr<CommandLine> Read(std::vector<const char*> flags) {
  flags.insert(flags.begin(), "deformd");
  return ReadCommandLine(static_cast<int>(flags.size()), flags.data());
}

std::string FileWith(const std::string& text) {
  return Temporary().Write("deformd.toml", text);
}

TEST(Options, HaveDefaultsThatWork) {
  const CommandLine line = Read({}).value();
  EXPECT_EQ(line.options.listen, "127.0.0.1:7777");
  EXPECT_EQ(line.options.data_dir, "deformd-data");
  EXPECT_FALSE(line.options.in_memory);
  EXPECT_FALSE(line.exit);
  EXPECT_TRUE(CheckOptions(line.options).ok());
}

TEST(Options, AreTakenFromFlags) {
  const CommandLine line =
      Read({"--listen", "0.0.0.0:0", "--in-memory", "--max-model-bytes",
            "512 MiB", "--max-sessions=3", "--stall-timeout", "2.5",
            "--config-check"})
          .value();
  EXPECT_EQ(line.options.listen, "0.0.0.0:0");
  EXPECT_EQ(line.options.max_model_bytes.value, 512 << 20);
  EXPECT_EQ(line.options.max_sessions, 3);
  EXPECT_EQ(line.options.stall_timeout.milliseconds().count(), 2500);
  EXPECT_TRUE(line.check_only);
}

TEST(Options, AreTakenFromAFileAndFlagsWin) {
  const std::string file =
      FileWith("listen = \"unix:/run/d\"\nmax-models = 7\nmax-bindings = 8\n");
  const CommandLine line =
      Read({"--config", file.c_str(), "--max-models", "9"}).value();
  EXPECT_EQ(line.options.listen, "unix:/run/d");
  EXPECT_EQ(line.options.max_models, 9);
  EXPECT_EQ(line.options.max_bindings, 8);
}

TEST(Options, WrittenAsTomlAreReadAsTheyWere) {
  Options options;
  options.max_model_bytes = {123456789};
  options.max_bindings_memory = {int64_t{3} << 40};
  options.stall_timeout = {0.25};
  options.max_participants = 7;
  options.weight_tolerance = {3e-4};
  const std::string toml = WriteToml(options);
  Options read;
  ASSERT_TRUE(ReadToml(toml, "f", read).ok());
  EXPECT_EQ(WriteToml(read), toml);
  EXPECT_EQ(read.max_bindings_memory.value, int64_t{3} << 40);
  EXPECT_EQ(read.stall_timeout.value, 0.25);
}

TEST(Options, WrittenAsTomlAreExplained) {
  const std::string toml = WriteToml({});
  EXPECT_THAT(toml, HasSubstr("# Sessions of all tenants.\n"
                              "max-sessions = 1000\n"));
  size_t begin = 0;
  for (size_t end; (end = toml.find('\n', begin)) != std::string::npos;
       begin = end + 1) {
    EXPECT_LE(end - begin, 80u) << toml.substr(begin, end - begin);
  }
}

TEST(Options, NamesAFileThatCannotBeRead) {
  EXPECT_EQ(Read({"--config", "/no/such/file"}).status().message(),
            "cannot read /no/such/file");
}

struct BadToml {
  const char* name;
  const char* text;
  const char* message;
};

class TomlRefused : public testing::TestWithParam<BadToml> {};

TEST_P(TomlRefused, NamesFileLineAndWhatToMend) {
  Options options;
  const absl::Status status =
      ReadToml(GetParam().text, "deformd.toml", options);
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()), HasSubstr(GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(
    Files, TomlRefused,
    testing::ValuesIn<BadToml>({
        {"UnknownKey", "\nmax-modle-bytes = 1\n",
         "deformd.toml:2: unknown key \"max-modle-bytes\""},
        {"Table", "[limits]\nmax-models = 1\n",
         "deformd.toml:1: unknown key \"limits\""},
        {"Syntax", "listen = \"a:1\"\nmax-models = \n", "deformd.toml:2: "},
        {"Twice", "max-models = 1\nmax-models = 2\n", "deformd.toml:2: "},
        {"StringForNumber", "max-models = \"7\"\n",
         "deformd.toml:1: max-models: is a whole number"},
        {"NumberForString", "listen = 7777\n",
         "deformd.toml:1: listen: is a string, in quotes"},
        {"Fraction", "max-models = 7.5\n", "max-models: is a whole number"},
        {"Bytes", "max-model-bytes = \"7 bushels\"\n",
         "max-model-bytes: is a number of bytes such as 1048576"},
        {"NegativeBytes", "max-model-bytes = -1\n",
         "max-model-bytes: is a number of bytes"},
        {"OutOfRange", "\n\nmax-participants = 0\n",
         "deformd.toml:3: max-participants: must be between 1 and 100000, not "
         "0"},
        {"Tolerance", "weight-tolerance = 0.5\n",
         "weight-tolerance: must be 0 or between 1e-06 and 0.01, not 0.5"},
        {"NoTolerance", "weight-tolerance = nan\n",
         "weight-tolerance: must be 0 or between 1e-06 and 0.01, not nan"},
        {"TextForTolerance", "weight-tolerance = \"1e-5\"\n",
         "weight-tolerance: is a number"},
        {"BeyondInt", "max-participants = 4294967297\n",
         "max-participants: is a whole number, not \"4294967297\""},
        {"Seconds", "stall-timeout = \"soon\"\n",
         "stall-timeout: is a number of seconds"},
        {"NotANumber", "stall-timeout = nan\n",
         "stall-timeout: must be between 0.1 and 86400, not nan"},
        {"Level", "log-level = \"loud\"\n",
         "log-level: is one of trace, debug, info, warn, error, off, not "
         "\"loud\""},
        {"NoPort", "listen = \"localhost\"\n",
         "listen: is HOST:PORT or unix:PATH, not \"localhost\""},
        {"BadPort", "listen = \"localhost:70000\"\n",
         "not \"localhost:70000\""},
        {"InMemory", "in-memory = \"no\"\n", "in-memory: is true or false"},
        {"NoDirectory", "data-dir = \"\"\n", "data-dir: is empty"},
    }),
    [](const auto& test) { return test.param.name; });

TEST(Options, RefusesFlagsThatCannotWork) {
  testing::internal::CaptureStderr();
  const CommandLine line = Read({"--max-participants", "many"}).value();
  EXPECT_TRUE(line.exit);
  EXPECT_NE(line.exit_code, 0);
  EXPECT_THAT(testing::internal::GetCapturedStderr(),
              HasSubstr("max-participants: is a whole number, not \"many\""));
}

TEST(Options, RefusesUnknownFlags) {
  testing::internal::CaptureStderr();
  EXPECT_NE(Read({"--max-modles", "1"})->exit_code, 0);
  EXPECT_THAT(testing::internal::GetCapturedStderr(),
              HasSubstr("--max-modles"));
}

TEST(Options, RefusesWaitingCallsThatLockOutTheOthers) {
  Options options;
  options.max_waiting_binds = options.max_call_threads;
  const absl::Status status = CheckOptions(options);
  EXPECT_EQ(DetailOf(status).field, "max-waiting-binds");
  EXPECT_THAT(std::string(status.message()),
              HasSubstr("must be less than max-call-threads (64)"));
}

}  // namespace
}  // namespace deform::server
