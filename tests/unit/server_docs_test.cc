// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// server/README.md says what the code does: routes with their parameters, problem codes, flags.
#include <algorithm>
#include <fstream>
#include <regex>
#include <set>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/options.h"
#include "server/problem.h"
#include "server/service.h"

namespace pliant::server {
namespace {

std::string Readme() {
  std::ifstream file(PLIANT_SOURCE_DIR "/server/README.md");
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

// The text between the heading and the next one of the same level.
std::string Section(const std::string& heading) {
  const std::string text = Readme();
  const std::size_t begin = text.find("## " + heading + "\n");
  EXPECT_NE(begin, std::string::npos) << heading;
  const std::size_t end = text.find("\n## ", begin + 1);
  return text.substr(begin, end - begin);
}

std::set<std::string> FirstGroups(const std::string& text, const std::string& pattern) {
  std::set<std::string> found;
  const std::regex regex(pattern);
  for (std::sregex_iterator it(text.begin(), text.end(), regex), end; it != end; ++it) {
    found.insert((*it)[1]);
  }
  return found;
}

TEST(ServerReadme, ListsEveryRouteWithItsParameters) {
  Service service(ServerOptions{});
  std::set<std::string> routes;
  for (const Route& route : MakeRoutes(service)) {
    if (route.name == "page" && route.pattern != "/") continue;
    std::string parameters;
    for (const std::string& name : route.parameters) {
      parameters += (parameters.empty() ? "`" : ", `") + name + "`";
    }
    routes.insert("`" + route.method + " " + route.pattern + "` | " +
                  (parameters.empty() ? "-" : parameters) + " |");
  }
  EXPECT_EQ(FirstGroups(Section("Routes"), R"(\| (`[A-Z]+ /[^|]*` \| [^|]* \|))"), routes);
}

TEST(ServerReadme, ListsEveryProblemCode) {
  std::set<std::string> codes;
  for (const ProblemCode& code : ProblemCodes()) {
    codes.insert(std::to_string(code.status) + " | `" + code.code + "` | " + code.meaning + " |");
  }
  EXPECT_EQ(FirstGroups(Section("Problem codes"), R"(\| (\d+ \| `[a-z_]+` \| [^|]* \|))"), codes);
}

TEST(ServerReadme, ListsEveryFlagWithItsDefault) {
  const std::string help = HelpText();
  const std::set<std::string> documented = FirstGroups(Section("Flags"), R"(\| `(--[a-z-]+)`)");
  std::set<std::string> offered = FirstGroups(help, R"(\n +(?:-h,)?(--[a-z-]+))");
  EXPECT_GT(offered.size(), 20U);
  EXPECT_EQ(documented, offered);
  const std::set<std::string> table =
      FirstGroups(Section("Flags"), R"(\| (`--[a-z-]+` \| [^|]* \|))");
  for (const std::string& line : table) {
    std::smatch parts;
    ASSERT_TRUE(std::regex_match(line, parts, std::regex(R"(`(--[a-z-]+)` \| (.*) \|)")));
    const std::string flag = parts[1];
    const std::string value = std::regex_replace(parts[2].str(), std::regex("`"), "");
    if (value == "-") continue;
    const std::size_t at = help.find("\n  " + flag + " ");
    ASSERT_NE(at, std::string::npos) << flag;
    const std::string in_help = help.substr(at, help.find('\n', at + 1) - at);
    const std::regex with_default(R"( [A-Z:]+( in \[[^\]]*\]|:\{.*\})?=)" + value + " ");
    EXPECT_TRUE(std::regex_search(in_help, with_default))
        << in_help << " is documented as " << value;
  }
}

TEST(ServerOptions, ReadsFlagsEnvironmentAndFile) {
  const std::string file = testing::TempDir() + "pliant-server-test.toml";
  std::ofstream(file)
      << "queue-length = 7\nhttp-threads = 9\nmax-body-mb = 3\nauto-train = false\n";
  setenv("PLIANT_HTTP_THREADS", "11", 1);
  const char* argv[] = {"pliant-server", "--db",          "x.db", "--config",
                        file.c_str(),    "--max-body-mb", "5"};
  const ParsedCommandLine parsed = ParseCommandLine(7, argv);
  unsetenv("PLIANT_HTTP_THREADS");
  ASSERT_FALSE(parsed.finished);
  EXPECT_EQ(parsed.options.queue_length, 7);
  EXPECT_FALSE(parsed.options.auto_train);
  EXPECT_TRUE(parsed.options.keep_originals);
  EXPECT_EQ(parsed.options.http_threads, 11) << "the environment comes before the file";
  EXPECT_EQ(parsed.options.max_body_mb, 5) << "a flag comes before the file";
  EXPECT_EQ(MakeHttpOptions(parsed.options).limits.max_body_bytes, 5U << 20);
}

TEST(ServerOptions, KeepsToLoopbackUnlessTold) {
  ServerOptions options;
  for (const char* listen : {"127.0.0.1:0", "127.1.2.3:80", "localhost:8080", "[::1]:1"}) {
    options.listen = listen;
    EXPECT_NO_THROW(CheckExposure(options)) << listen;
  }
  options.listen = "0.0.0.0:8080";
  EXPECT_THROW(CheckExposure(options), Error);
  options.allow_open_access = true;
  EXPECT_NO_THROW(CheckExposure(options));
  for (const char* listen : {"", "8080", ":8080", "host:", "host:x", "host:70000", "host:-1"}) {
    options.listen = listen;
    EXPECT_THROW(MakeHttpOptions(options), Error) << listen;
  }
}

}  // namespace
}  // namespace pliant::server
