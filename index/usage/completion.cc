// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/usage/completion.h"

#include <algorithm>
#include <vector>

#include "descriptor/base/error.h"
#include "index/usage/option_words.h"

namespace pliant::cli {
namespace {

std::string Joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : " ") + word;
  return text;
}

// 'it'\''s'
std::string Quoted(const std::string& text) {
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

std::vector<std::string> Options(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : DashedOptions(app)) {
    for (const std::string& name : NamesOf(*option)) names.push_back(name);
  }
  return names;
}

// A function body that both bash and zsh understand: it finds the command in `words`, and prints
// what may stand after `prev` in place of `cur`; nothing where a file may.
std::string Candidates(const CLI::App& program) {
  std::string paths;
  std::string values;
  std::string own;
  for (const NamedCommand& command : AllCommands(program)) {
    if (command.app != &program) paths += (paths.empty() ? "" : "|") + Quoted(command.path);
    for (const CLI::Option* option : DashedOptions(*command.app)) {
      if (!TakesValue(*option)) continue;
      std::string cases;
      for (const std::string& name : NamesOf(*option)) {
        cases += (cases.empty() ? "" : "|") + Quoted(command.path + " " + name);
      }
      values += "    " + cases + ") echo " + Quoted(Joined(ValueWords(*option))) + "; return ;;\n";
    }
    own += "    " + Quoted(command.path) + ")\n      case \"$cur\" in\n        -*) echo " +
           Quoted(Joined(Options(*command.app))) + " ;;\n        *) echo " +
           Quoted(Joined(CommandNames(*command.app))) + " ;;\n      esac ;;\n";
  }
  std::string text =
      "  local cur=$1 prev=$2 path=" + Quoted(program.get_name()) + " word\n  shift 2\n";
  if (!paths.empty()) {
    text += "  for word in \"$@\"; do\n    case \"$path $word\" in\n      " + paths +
            ") path=\"$path $word\" ;;\n    esac\n  done\n";
  }
  return text + "  case \"$path $prev\" in\n" + values + "  esac\n  case \"$path\" in\n" + own +
         "  esac\n";
}

// A name that a shell's function may have.
std::string FunctionName(const CLI::App& program) {
  std::string name = "_" + program.get_name();
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
}

std::string Bash(const CLI::App& program) {
  const std::string name = FunctionName(program);
  return "# bash completion for " + program.get_name() + "\n" + name + "_candidates() {\n" +
         Candidates(program) + "}\n" + name +
         "() {\n"
         "  local cur=${COMP_WORDS[COMP_CWORD]} prev=${COMP_WORDS[COMP_CWORD - 1]} candidates\n"
         "  if [ \"$cur\" = = ]; then cur=; elif [ \"$prev\" = = ]; then "
         "prev=${COMP_WORDS[COMP_CWORD - 2]}; fi\n"  // --option=value is three words
         "  candidates=$(" +
         name +
         "_candidates \"$cur\" \"$prev\" "
         "\"${COMP_WORDS[@]:1:COMP_CWORD-1}\")\n"
         "  mapfile -t COMPREPLY < <(compgen -W \"$candidates\" -- \"$cur\")\n"
         "}\n"
         "complete -o default -F " +
         name + " " + program.get_name() + "\n";
}

std::string Zsh(const CLI::App& program) {
  const std::string name = FunctionName(program);
  return "#compdef " + program.get_name() + "\n" + name + "_candidates() {\n" +
         Candidates(program) + "}\n" + name +
         "() {\n"
         "  local -a candidates\n"
         "  candidates=(${=\"$(" +
         name +
         "_candidates \"$words[CURRENT]\" \"$words[CURRENT-1]\" \"${(@)words[2,CURRENT-1]}\")\"})\n"
         "  if (( $#candidates )); then compadd -- $candidates; else _files; fi\n"
         "}\n"
         "if [ \"$funcstack[1]\" = " +
         name + " ]; then " + name + " \"$@\"; else compdef " + name + " " + program.get_name() +
         "; fi\n";
}

std::string Fish(const CLI::App& program) {
  const std::string name = program.get_name();
  const std::string helper = "_" + FunctionName(program);
  std::string text = "# fish completion for " + name + "\nfunction " + helper +
                     "\n    set -l path " + Quoted(name) +
                     "\n    for word in (commandline -opc)[2..-1]\n"
                     "        switch \"$path $word\"\n";
  std::string lines;
  for (const NamedCommand& command : AllCommands(program)) {
    if (command.app != &program) {
      text += "            case " + Quoted(command.path) + "\n                set path " +
              Quoted(command.path) + "\n";
    }
    const std::string when =
        "complete -c " + name + " -n " + Quoted(helper + " " + Quoted(command.path));
    for (const CLI::App* sub : command.app->get_subcommands([](const CLI::App*) { return true; })) {
      lines += when + " -f -a " + Quoted(sub->get_name()) + " -d " +
               Quoted(sub->get_description()) + "\n";
    }
    for (const CLI::Option* option : DashedOptions(*command.app)) {
      lines += when;
      for (const std::string& long_name : option->get_lnames()) lines += " -l " + long_name;
      for (const std::string& short_name : option->get_snames()) lines += " -s " + short_name;
      const std::vector<std::string> words = ValueWords(*option);
      if (!words.empty()) lines += " -x -a " + Quoted(Joined(words));
      if (words.empty() && TakesValue(*option)) lines += " -r";
      lines += " -d " + Quoted(option->get_description()) + "\n";
    }
  }
  return text + "        end\n    end\n    test \"$path\" = \"$argv[1]\"\nend\n" + lines;
}

}  // namespace

std::string CompletionScript(const CLI::App& program, const std::string& shell) {
  if (shell == "bash") return Bash(program);
  if (shell == "zsh") return Zsh(program);
  if (shell == "fish") return Fish(program);
  throw Error(ErrorCode::kInvalidArgument, "bad_shell",
              "completion is for bash, zsh and fish, not for " + shell);
}

}  // namespace pliant::cli
