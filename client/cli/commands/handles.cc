// deformctl handles: adds, moves and removes handles of a binding.
#include <CLI/CLI.hpp>
#include <cmath>
#include <memory>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "client/cli/command.h"
#include "client/cli/exit_code.h"
#include "client/cli/info_text.h"
#include "client/cli/progress.h"
#include "core/base/status_macros.h"

namespace deform::cli {
namespace {

struct Options {
  std::string binding;
  std::vector<std::string> add;
  std::vector<std::string> move;
  std::vector<std::string> remove;
  std::vector<std::string> sessions;
  bool keep_sessions = false;
};

absl::StatusOr<std::vector<double>> Numbers(const std::string& text,
                                            absl::string_view option) {
  std::vector<double> numbers;
  for (const absl::string_view word :
       absl::StrSplit(absl::string_view(text), ',')) {
    double number = 0;
    if (!absl::SimpleAtod(word, &number)) {
      return UsageError(
          absl::StrCat(option, " ", text, ": '", word, "' is no number"));
    }
    numbers.push_back(number);
  }
  return numbers;
}

absl::StatusOr<int64_t> HandleOf(double number, const std::string& text,
                                 absl::string_view option) {
  if (number >= 0 && number < 1e9 && number == std::floor(number)) {
    return static_cast<int64_t>(number);
  }
  return UsageError(absl::StrCat(option, " ", text,
                                 ": it begins with the number of a handle"));
}

// `first` numbers stand before the coordinates.
Vec3 PlaceOf(const std::vector<double>& numbers, size_t first, int dimension) {
  Vec3 place = Vec3::Zero();
  for (int d = 0; d < dimension; ++d) place[d] = numbers[first + d];
  return place;
}

absl::StatusOr<HandleEdit> ParseAdd(const std::string& text, int dimension) {
  DEFORM_ASSIGN_OR_RETURN(const std::vector<double> numbers,
                          Numbers(text, "--add"));
  const auto count = std::ssize(numbers);
  if (count != dimension && count != dimension + 1) {
    return UsageError(absl::StrCat("--add ", text, ": ", dimension,
                                   " coordinates, and then perhaps a weight"));
  }
  HandleEdit edit{.kind = HandleEdit::Kind::kAdd,
                  .position = PlaceOf(numbers, 0, dimension)};
  if (count > dimension) edit.weight = numbers.back();
  return edit;
}

absl::StatusOr<HandleEdit> ParseMove(const std::string& text, int dimension) {
  DEFORM_ASSIGN_OR_RETURN(const std::vector<double> numbers,
                          Numbers(text, "--move"));
  if (std::ssize(numbers) != dimension + 1) {
    return UsageError(absl::StrCat("--move ", text, ": a handle, and then its ",
                                   dimension, " coordinates"));
  }
  HandleEdit edit{.kind = HandleEdit::Kind::kMove,
                  .position = PlaceOf(numbers, 1, dimension)};
  DEFORM_ASSIGN_OR_RETURN(edit.handle, HandleOf(numbers[0], text, "--move"));
  return edit;
}

absl::StatusOr<std::vector<HandleEdit>> ParseEdits(const Options& options,
                                                   int dimension) {
  std::vector<HandleEdit> edits;
  for (const std::string& text : options.remove) {
    DEFORM_ASSIGN_OR_RETURN(const std::vector<double> numbers,
                            Numbers(text, "--remove"));
    for (const double number : numbers) {
      HandleEdit edit{.kind = HandleEdit::Kind::kRemove};
      DEFORM_ASSIGN_OR_RETURN(edit.handle, HandleOf(number, text, "--remove"));
      edits.push_back(edit);
    }
  }
  for (const std::string& text : options.move) {
    DEFORM_ASSIGN_OR_RETURN(const HandleEdit edit, ParseMove(text, dimension));
    edits.push_back(edit);
  }
  for (const std::string& text : options.add) {
    DEFORM_ASSIGN_OR_RETURN(const HandleEdit edit, ParseAdd(text, dimension));
    edits.push_back(edit);
  }
  if (edits.empty()) {
    return UsageError("say what to edit: --add, --move or --remove");
  }
  return edits;
}

Json ToJson(const EditedBinding& edited) {
  Json moved = Json::array(), not_moved = Json::array();
  for (const MovedSession& session : edited.moved) {
    moved.push_back({{"session_id", session.session_id},
                     {"revision", session.revision},
                     {"largest_jump", session.largest_jump}});
  }
  for (const auto& [id, status] : edited.not_moved) {
    not_moved.push_back(
        {{"session_id", id}, {"message", std::string(status.message())}});
  }
  Json json = cli::ToJson(edited.binding);
  json["existed"] = edited.binding.existed;
  json["previous_handles"] = edited.previous;
  json["iterations_mean"] = edited.iterations_mean;
  json["iterations_mean_before"] = edited.iterations_mean_before;
  json["moved"] = moved;
  json["not_moved"] = not_moved;
  return json;
}

void Tell(const EditedBinding& edited, std::ostream& out) {
  Describe(edited.binding, out);
  out << absl::StrFormat(
      "%.2f Newton steps a point, %.2f of the binding before\n",
      edited.iterations_mean, edited.iterations_mean_before);
  for (const MovedSession& session : edited.moved) {
    out << absl::StrFormat(
        "session %s moved over at revision %d; largest jump %.2g of the "
        "diagonal\n",
        session.session_id, session.revision, session.largest_jump);
  }
  for (const auto& [id, status] : edited.not_moved) {
    out << "session " << id << " did not move: " << status.message() << "\n";
  }
}

absl::Status Run(const Options& options, Context& context) {
  DEFORM_ASSIGN_OR_RETURN(Client client, context.Connect());
  DEFORM_ASSIGN_OR_RETURN(const BindingInfo before,
                          client.GetBinding(options.binding));
  DEFORM_ASSIGN_OR_RETURN(const std::vector<HandleEdit> edits,
                          ParseEdits(options, before.dimension));
  Progress progress(context.console, "computing weights",
                    &context.interruption);
  DEFORM_ASSIGN_OR_RETURN(
      const EditedBinding edited,
      client.EditHandles(options.binding, edits,
                         {.sessions = options.sessions,
                          .keep_sessions = options.keep_sessions},
                         progress.callback()));
  context.console.Result(ToJson(edited),
                         [&](std::ostream& out) { Tell(edited, out); });
  return absl::OkStatus();
}

Action Setup(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  app.add_option("binding", options->binding, "Id of a binding of handles")
      ->required()
      ->type_name("BINDING");
  app.add_option("--add", options->add,
                 "Another handle, at this place at rest; t_cc: with a weight. "
                 "May be given again, as all of these")
      ->type_name("X,Y,Z[,WEIGHT]")
      ->allow_extra_args(false);
  app.add_option("--move", options->move,
                 "Handle I to another place at rest; numbers are those before "
                 "all edits")
      ->type_name("I,X,Y,Z")
      ->allow_extra_args(false);
  app.add_option("--remove", options->remove, "Handles to remove")
      ->type_name("I,...")
      ->allow_extra_args(false);
  auto* const keep = app.add_flag("--keep-sessions", options->keep_sessions,
                                  "No session moves to the new binding");
  app.add_option("--session", options->sessions,
                 "Only this session moves over, instead of all; may be given "
                 "again")
      ->type_name("SESSION")
      ->allow_extra_args(false)
      ->excludes(keep);
  return [options](Context& context) { return Run(*options, context); };
}

}  // namespace

const Command& HandlesCommand() {
  static const Command command = {
      "handles", "Add, move or remove handles while sessions go on",
      "deformctl handles $binding --add 0.1,0.2,0.3\n"
      "deformctl handles $binding --move 4,0,0,0.5 --remove 7,8\n"
      "deformctl handles $binding --add=-1,0,0,0.5 --session $session",
      "", Setup};
  return command;
}

}  // namespace deform::cli
