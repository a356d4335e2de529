// deformctl completion: scripts that complete commands and options.
#include <CLI/CLI.hpp>
#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "client/cli/command.h"

namespace deform::cli {
namespace {

// A long option, "--cage", and what it is about.
struct Flag {
  std::string name;
  std::string help;
  bool takes_value;
};

void AddFlags(const CLI::App& app, std::vector<Flag>& flags) {
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_lnames()) {
      flags.push_back({absl::StrCat("--", name), option->get_description(),
                       option->get_items_expected_max() > 0});
    }
  }
  // Option groups are apps without a name.
  for (const CLI::App* group : app.get_subcommands({})) {
    if (group->get_name().empty()) AddFlags(*group, flags);
  }
}

std::vector<Flag> FlagsOf(const CLI::App& app) {
  std::vector<Flag> flags;
  AddFlags(app, flags);
  return flags;
}

std::string Names(const std::vector<Flag>& flags) {
  return absl::StrJoin(flags, " ", [](std::string* out, const Flag& flag) {
    out->append(flag.name);
  });
}

std::string CommandNames(absl::string_view separator) {
  return absl::StrJoin(
      AllCommands(), separator,
      [](std::string* out, const Command* c) { out->append(c->name); });
}

// One case per command: its words and options.
std::string Cases(const CLI::App& root, absl::string_view assign) {
  std::string text;
  const std::string globals = Names(FlagsOf(root));
  for (const Command* command : AllCommands()) {
    absl::StrAppend(&text, "    ", command->name, ") ", assign, "=\"",
                    command->words, *command->words == 0 ? "" : " ",
                    Names(FlagsOf(*root.get_subcommand(command->name))), " ",
                    globals, "\" ;;\n");
  }
  absl::StrAppend(&text, "    *) ", assign, "=\"", CommandNames(" "), " ",
                  globals, "\" ;;\n");
  return text;
}

// Finds the command among the words so far.
std::string FindCommand(absl::string_view words) {
  return absl::StrCat("  for word in ", words, "; do\n    case \"$word\" in\n",
                      "      ", CommandNames("|"),
                      ") command=\"$word\"; break ;;\n    esac\n  done\n");
}

std::string Bash(const CLI::App& root) {
  return absl::StrCat(
      "# Completion of deformctl for bash:  source <(deformctl completion "
      "bash)\n"
      "_deformctl() {\n"
      "  local word command='' words\n",
      FindCommand("\"${COMP_WORDS[@]:1:COMP_CWORD-1}\""),
      "  case \"$command\" in\n", Cases(root, "words"),
      "  esac\n"
      "  COMPREPLY=($(compgen -W \"$words\" -- "
      "\"${COMP_WORDS[COMP_CWORD]}\"))\n"
      "}\n"
      "complete -o default -o bashdefault -F _deformctl deformctl\n");
}

std::string Zsh(const CLI::App& root) {
  return absl::StrCat(
      "#compdef deformctl\n"
      "# Completion of deformctl for zsh: put it as _deformctl into $fpath\n"
      "_deformctl() {\n"
      "  local word command='' choices\n",
      FindCommand("\"${words[@]:1:CURRENT-2}\""), "  case \"$command\" in\n",
      Cases(root, "choices"),
      "  esac\n"
      "  if [[ -n \"$command\" && \"${words[CURRENT]}\" != -* ]]; then _files; "
      "fi\n"
      "  compadd -- ${=choices}\n"
      "}\n"
      "compdef _deformctl deformctl\n");
}

std::string FishQuoted(absl::string_view text) {
  return absl::StrCat(
      "'", absl::StrReplaceAll(text, {{"\\", "\\\\"}, {"'", "\\'"}}), "'");
}

void AppendFish(const std::string& condition, const std::vector<Flag>& flags,
                std::string& text) {
  for (const Flag& flag : flags) {
    absl::StrAppend(&text, "complete -c deformctl", condition, " -l ",
                    flag.name.substr(2), flag.takes_value ? " -r" : "", " -d ",
                    FishQuoted(flag.help), "\n");
  }
}

std::string Fish(const CLI::App& root) {
  std::string text =
      "# Completion of deformctl for fish:  deformctl completion fish | "
      "source\n";
  AppendFish("", FlagsOf(root), text);
  for (const Command* command : AllCommands()) {
    absl::StrAppend(&text, "complete -c deformctl -n __fish_use_subcommand -a ",
                    command->name, " -d ", FishQuoted(command->summary), "\n");
    const std::string condition =
        absl::StrCat(" -n '__fish_seen_subcommand_from ", command->name, "'");
    if (*command->words != 0) {
      absl::StrAppend(&text, "complete -c deformctl", condition, " -f -a ",
                      FishQuoted(command->words), "\n");
    }
    AppendFish(condition, FlagsOf(*root.get_subcommand(command->name)), text);
  }
  return text;
}

absl::Status Run(const std::string& shell, Context& context) {
  const std::string script = shell == "bash"  ? Bash(context.root)
                             : shell == "zsh" ? Zsh(context.root)
                                              : Fish(context.root);
  context.console.Result({{"shell", shell}, {"script", script}},
                         [&](std::ostream& out) { out << script; });
  return absl::OkStatus();
}

Action Setup(CLI::App& app) {
  const auto shell = std::make_shared<std::string>();
  app.add_option("shell", *shell, "Which shell")
      ->required()
      ->check(CLI::IsMember({"bash", "zsh", "fish"}));
  return [shell](Context& context) { return Run(*shell, context); };
}

}  // namespace

const Command& CompletionCommand() {
  static const Command command = {"completion",
                                  "Print a completion script for a shell",
                                  "source <(deformctl completion bash)\n"
                                  "deformctl completion fish | source",
                                  "bash zsh fish", Setup};
  return command;
}

}  // namespace deform::cli
