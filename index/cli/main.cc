// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <csignal>
#include <filesystem>
#include <memory>
#include <new>
#include <string>
#include <vector>

#include <unistd.h>

#include "descriptor/base/reuse_memory.h"
#include "index/cli/command.h"
#include "index/cli/interrupt.h"
#include "index/cli/output.h"
#include "index/usage/usage.h"

namespace pliant::cli {
namespace {

constexpr const char* kFooter =
    "Exit status: 0 done, 1 failed, 2 wrong usage, 3 done but some inputs were skipped,\n"
    "130 stopped by Ctrl-C (128 and the signal).\n"
    "Start with:  pliant index IMAGES/ --db my.db\n"
    "             pliant query PHOTO.jpg --db my.db";

// Whether the subcommand that ran was asked for JSON: then failures are JSON as well.
bool WantsJson(const CLI::App& app) {
  for (const CLI::App* sub : app.get_subcommands()) {
    const CLI::Option* json = sub->get_option_no_throw("--json");
    if ((json != nullptr && json->count() > 0) || WantsJson(*sub)) return true;
  }
  return false;
}

// Help shows each option's default, except for empty lists and required options.
void HideEmptyDefaults(CLI::App& app) {
  for (CLI::Option* option : app.get_options()) {
    const std::string text = option->get_default_str();
    if (text == "[]" || text == "{}" || option->get_required()) option->default_str("");
  }
  for (CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; })) {
    HideEmptyDefaults(*sub);
  }
}

#ifdef PLIANT_WITH_VIDEO
void AddVideoCommands(CLI::App& program, CLI::App& eval, ExitStatus& status) {
  AddEvalTracking(eval, status);
  AddTrackCommand(program, status);
}
#else
// The libraries that read videos take longer to load than a query takes: pliant-video has them, and
// all commands.
void Forward(CLI::App& app, std::vector<const char*> before) {
  app.prefix_command();
  app.set_help_flag();
  app.callback([&app, before = std::move(before)] {
    const std::filesystem::path program =
        std::filesystem::read_symlink("/proc/self/exe").replace_filename("pliant-video");
    const std::vector<std::string> rest = app.remaining();
    std::vector<const char*> arguments = before;
    for (const std::string& argument : rest) arguments.push_back(argument.c_str());
    arguments.push_back(nullptr);
    execv(program.c_str(), const_cast<char* const*>(arguments.data()));  // takes no others
    throw Error(
        ErrorCode::kNotFound, "program_missing",
        program.string() + ", which reads videos, is not installed (Debian package pliant-video)");
  });
}

void AddVideoCommands(CLI::App& program, CLI::App& eval, ExitStatus& /*status*/) {
  Forward(*eval.add_subcommand("tracking", kEvalTracking), {"pliant", "eval", "tracking"});
  Forward(*program.add_subcommand("track", kTrack), {"pliant", "track"});
}
#endif

void AddCommands(CLI::App& program, ExitStatus& status) {
  program.option_defaults()->always_capture_default();  // of the commands, too
  AddIndexCommand(program, status);
  AddQueryCommand(program, status);
  AddSelfTestCommand(program, status);
  AddVocabCommand(program, status);
  AddDbCommand(program, status);
  AddDescribeCommand(program, status);
  AddSimulateCommand(program, status);
  AddMatchCommand(program, status);
  CLI::App* eval = program.add_subcommand("eval", "Evaluate descriptors on a data set");
  eval->require_subcommand(1);
  eval->footer("Example:  pliant eval matching scenes/");
  AddEvalMatching(*eval, status);
  AddEvalRetrieval(*eval, status);
  AddVideoCommands(program, *eval, status);
  HideEmptyDefaults(program);
}

ExitStatus Run(int argc, char** argv) {
  CLI::App program("Find the same object again, however it is bent, folded or crumpled.", "pliant");
  program.formatter(std::make_shared<HelpFormatter>());
  program.set_version_flag("--version", std::string("pliant ") + PLIANT_VERSION);
  program.footer(kFooter);
  program.failure_message(UsageError);
  program.require_subcommand(1);
  ExitStatus status = ExitStatus::kDone;
  AddCommands(program, status);
  try {
    program.parse(argc, argv);
    FlushOutput();
    return status;
  } catch (const CLI::ParseError& error) {
    if (program.exit(error) == 0) return ExitStatus::kDone;
    if (WantsJson(program)) {
      PrintJson({{"error", {{"code", "wrong_usage"}, {"message", error.what()}}}});
    }
    return ExitStatus::kWrongUsage;
  } catch (const Error& error) {
    ReportError(error, program, WantsJson(program));
    return ToExitStatus(error.code());
  } catch (const std::bad_alloc&) {
    ReportError({ErrorCode::kUnavailable, "out_of_memory", "not enough memory"}, program,
                WantsJson(program));
  } catch (const std::exception& error) {
    ReportError({ErrorCode::kInternal, "internal", error.what()}, program, WantsJson(program));
  }
  return ExitStatus::kFailed;
}

}  // namespace
}  // namespace pliant::cli

int main(int argc, char** argv) {
  // A file size limit and a closed pipe cause errors of the write; they do not kill the process.
  std::signal(SIGXFSZ, SIG_IGN);
  std::signal(SIGPIPE, SIG_IGN);
  pliant::ReuseMemory();
  const auto status = static_cast<int>(pliant::cli::Run(argc, argv));
  // After a stop by a signal the exit status is that of a process that the signal ended.
  const int number = pliant::cli::Interrupt::Signal();
  return number != 0 && status != 0 ? 128 + number : status;
}
