// deformctl weights: dumps the weights of a binding.
#include <CLI/CLI.hpp>
#include <fstream>
#include <iostream>
#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "client/cli/command.h"
#include "client/cli/exit_code.h"
#include "client/cli/progress.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace deform::cli {
namespace {

struct Options {
  std::string binding;
  bool in_double = false;
  std::string format = "csv";
  std::string out;
  int64_t first = 0;
  int64_t count = 0;
};

// Writes rows one after the other, below a line of titles in CSV; a row's
// vertex weights come first.
class RowWriter {
 public:
  RowWriter(const Options& options, std::ostream& out)
      : options_(options), out_(out) {}

  void Row(int64_t point, const WeightRows& rows, int64_t i) {
    std::string text;
    const bool csv = options_.format == "csv";
    if (csv && !begun_) AddTitles(rows, text);
    begun_ = true;
    if (csv) absl::StrAppend(&text, point);
    for (const double weight : rows.vertex.row(i)) Add(weight, csv, text);
    for (const double weight : rows.normal.row(i)) Add(weight, csv, text);
    if (csv) text += '\n';
    out_.write(text.data(), static_cast<std::streamsize>(text.size()));
  }

 private:
  void Add(double weight, bool csv, std::string& text) const {
    if (csv && options_.in_double) {
      absl::StrAppendFormat(&text, ",%.17g", weight);
    } else if (csv) {
      absl::StrAppendFormat(&text, ",%.9g", weight);
    } else if (options_.in_double) {
      text.append(reinterpret_cast<const char*>(&weight), sizeof(weight));
    } else {
      const auto narrow = static_cast<float>(weight);
      text.append(reinterpret_cast<const char*>(&narrow), sizeof(narrow));
    }
  }

  static void AddTitles(const WeightRows& rows, std::string& text) {
    text = "point";
    for (int64_t k = 0; k < rows.vertex.cols(); ++k) {
      absl::StrAppend(&text, ",v", k);
    }
    for (int64_t j = 0; j < rows.normal.cols(); ++j) {
      absl::StrAppend(&text, ",n", j);
    }
    text += '\n';
  }

  const Options& options_;
  std::ostream& out_;
  bool begun_ = false;
};

absl::Status NotWritten(const std::string& path) {
  return WithExit(kBadFile,
                  InvalidInput("FILE_NOT_WRITABLE", "",
                               absl::StrCat(path, ": cannot be written")));
}

// Calls `row` for every row that was asked for.
absl::Status ForRows(
    Client& client, const Options& options, const BindingInfo& binding,
    Console& console,
    absl::FunctionRef<void(int64_t, const WeightRows&, int64_t)> row) {
  Progress progress(console, "fetching weights", nullptr);
  const int64_t total =
      options.count > 0 ? options.count : binding.point_count - options.first;
  return client.GetWeights(
      options.binding,
      options.in_double ? WeightPrecision::kRecomputedFloat64
                        : WeightPrecision::kCachedFloat32,
      options.first, options.count, [&](const WeightRows& rows) {
        for (int64_t i = 0; i < rows.vertex.rows(); ++i) {
          row(rows.first_point + i, rows, i);
        }
        progress.Show(rows.first_point + rows.vertex.rows() - options.first,
                      total);
        return absl::OkStatus();
      });
}

Json Shape(const Options& options, const BindingInfo& binding) {
  return {{"binding_id", binding.binding_id},
          {"precision", options.in_double ? "float64" : "float32"},
          {"vertex_count", binding.vertex_count + binding.fixed_handle_count},
          {"normal_count", binding.normal_count}};
}

absl::Status PrintJson(Client& client, const Options& options,
                       const BindingInfo& binding, Console& console) {
  Json json = Shape(options, binding);
  Json points = Json::array();
  DEFORM_RETURN_IF_ERROR(
      ForRows(client, options, binding, console,
              [&](int64_t point, const WeightRows& rows, int64_t i) {
                const std::vector<double> vertex(rows.vertex.row(i).begin(),
                                                 rows.vertex.row(i).end());
                const std::vector<double> normal(rows.normal.row(i).begin(),
                                                 rows.normal.row(i).end());
                points.push_back(
                    {{"point", point}, {"vertex", vertex}, {"normal", normal}});
              }));
  json["points"] = std::move(points);
  console.Result(json, [](std::ostream&) {});
  return absl::OkStatus();
}

absl::Status WriteInto(Client& client, const Options& options,
                       const BindingInfo& binding, Console& console) {
  std::ofstream file(options.out, std::ios::binary | std::ios::trunc);
  if (!file) return NotWritten(options.out);
  RowWriter writer(options, file);
  int64_t count = 0;
  DEFORM_RETURN_IF_ERROR(
      ForRows(client, options, binding, console,
              [&](int64_t point, const WeightRows& rows, int64_t i) {
                writer.Row(point, rows, i);
                ++count;
              }));
  file.close();
  if (!file) return NotWritten(options.out);
  Json json = Shape(options, binding);
  json["rows"] = count;
  json["format"] = options.format;
  json["out"] = options.out;
  console.Result(json, [&](std::ostream& out) {
    out << "wrote " << options.out << ": " << Thousands(count) << " rows of "
        << Thousands(binding.vertex_count + binding.fixed_handle_count)
        << " vertex and " << Thousands(binding.normal_count)
        << " normal weights, " << json["precision"].get<std::string>() << "\n";
  });
  return absl::OkStatus();
}

absl::Status Run(const Options& options, Context& context) {
  if (options.format == "binary" && options.out.empty()) {
    return UsageError("--format binary needs --out FILE");
  }
  DEFORM_ASSIGN_OR_RETURN(Client client, context.Connect());
  DEFORM_ASSIGN_OR_RETURN(const BindingInfo binding,
                          client.GetBinding(options.binding));
  if (!options.out.empty()) {
    return WriteInto(client, options, binding, context.console);
  }
  if (context.console.json()) {
    return PrintJson(client, options, binding, context.console);
  }
  RowWriter writer(options, context.console.out());
  return ForRows(client, options, binding, context.console,
                 [&](int64_t point, const WeightRows& rows, int64_t i) {
                   writer.Row(point, rows, i);
                 });
}

Action Setup(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  app.add_option("binding", options->binding, "Id of the binding")
      ->required()
      ->type_name("BINDING");
  app.add_flag("--double", options->in_double,
               "Computed again in double, instead of what deforming uses");
  app.add_option(
         "--format", options->format,
         "csv, or binary: rows of little-endian numbers, vertex weights "
         "first")
      ->check(CLI::IsMember({"csv", "binary"}))
      ->capture_default_str();
  app.add_option("--out", options->out,
                 "File to write; without it rows are printed")
      ->type_name("FILE");
  app.add_option("--first", options->first, "First point")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app.add_option("--count", options->count,
                 "Number of points; 0: all that follow")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  return [options](Context& context) { return Run(*options, context); };
}

}  // namespace

const Command& WeightsCommand() {
  static const Command command = {
      "weights", "Dump the weights of a binding",
      "deformctl weights $binding --first 100 --count 5\n"
      "deformctl weights $binding --double --out weights.csv\n"
      "deformctl weights $binding --format binary --out weights.f32",
      "", Setup};
  return command;
}

}  // namespace deform::cli
