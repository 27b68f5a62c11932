// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The pages in server/reference say what the code does: routes with their parameters, problem
// codes, flags, metrics.
#include <algorithm>
#include <fstream>
#include <regex>
#include <set>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/app/options.h"
#include "server/http/problem.h"
#include "server/openapi/document.h"
#include "server/routes/routes.h"

namespace pliant::server {
namespace {

std::string Page(const std::string& name) {
  std::ifstream file(PLIANT_SOURCE_DIR "/server/reference/" + name);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

// The text between the heading and the next one of the same level.
std::string Section(const std::string& page, const std::string& heading) {
  const std::string text = Page(page);
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

// A search has a table of its parameters on a page of its own.
constexpr const char* kSearch = "/v1/collections/{c}/search";

TEST(ServerReference, ListsEveryRouteWithItsParameters) {
  Service service(ServiceOptions{});
  std::set<std::string> routes;
  for (const Route& route : MakeRoutes(service)) {
    if (route.name == "page" && route.pattern != "/") continue;
    std::string parameters;
    for (const Parameter& parameter : route.parameters) {
      parameters += (parameters.empty() ? "`" : ", `") + parameter.name + "`";
    }
    if (parameters.empty()) parameters = "-";
    if (route.pattern == kSearch) parameters = "[parameters](search.md#parameters)";
    routes.insert("`" + route.method + " " + route.pattern + "` | " + parameters + " |");
  }
  EXPECT_EQ(FirstGroups(Section("routes.md", "Routes"), R"(\| (`[A-Z]+ /[^|]*` \| [^|]* \|))"),
            routes);
}

TEST(ServerReference, ListsEveryParameterOfASearch) {
  Service service(ServiceOptions{});
  std::set<std::string> parameters;
  for (const Route& route : MakeRoutes(service)) {
    if (route.pattern != kSearch) continue;
    for (const Parameter& parameter : route.parameters) parameters.insert(parameter.name);
  }
  std::set<std::string> documented;
  const std::string section = Section("search.md", "Parameters");
  for (const std::string& cell : FirstGroups(section, R"(\n\| (`[^|]*) \|)")) {
    documented.merge(FirstGroups(cell, "`([a-z_]+)`"));
  }
  EXPECT_GT(documented.size(), 10U);
  EXPECT_EQ(documented, parameters);
}

TEST(ServerReference, ListsEveryProblemCode) {
  std::set<std::string> codes;
  for (const ProblemCode& code : ProblemCodes()) {
    codes.insert(std::to_string(code.status) + " | `" + code.code + "` | " + code.meaning + " |");
  }
  EXPECT_EQ(
      FirstGroups(Section("errors.md", "Problem codes"), R"(\| (\d+ \| `[a-z_]+` \| [^|]* \|))"),
      codes);
}

TEST(ServerReference, ListsEveryMetric) {
  Metrics metrics;
  metrics.OnRequest({});
  metrics.OnSearch({}, "shop");
  metrics.OnAdd({}, "shop");
  EngineStats stats;
  stats.vocabulary.emplace();
  std::set<std::string> expected;
  const std::string text = metrics.Text({.stats = &stats});
  const std::regex help("# HELP ([a-z_]+) ([^\n]*)");
  for (std::sregex_iterator it(text.begin(), text.end(), help), end; it != end; ++it) {
    expected.insert("`" + (*it)[1].str() + "` | " + (*it)[2].str() + " |");
  }
  EXPECT_GT(expected.size(), 10U);
  EXPECT_EQ(FirstGroups(Section("flags.md", "Metrics"), R"(\| (`[a-z_]+` \| [^|]* \|))"), expected);
}

TEST(Metrics, CountsByCollectionWithALimit) {
  Metrics metrics;
  for (int i = 0; i < 150; ++i) metrics.OnSearch({}, "c" + std::to_string(i));
  metrics.OnSearch({}, "c7");
  metrics.OnAdd({}, "c120");
  const std::string text = metrics.Text({});
  EXPECT_THAT(text, testing::HasSubstr("pliant_searches_total{collection=\"c7\"} 2"));
  EXPECT_THAT(text, testing::HasSubstr("pliant_searches_total{collection=\"(other)\"} 50"));
  EXPECT_THAT(text, testing::HasSubstr("pliant_images_added_total{collection=\"(other)\"} 1"));
  EXPECT_THAT(text, testing::Not(testing::HasSubstr("\"c100\"")));
}

TEST(Metrics, KeepsOneVocabularyAtATime) {
  Metrics metrics;
  EngineStats stats;
  stats.vocabulary.emplace().id = 1;
  EXPECT_THAT(metrics.Text({.stats = &stats}), testing::HasSubstr("id=\"1\""));
  stats.vocabulary->id = 2;
  const std::string text = metrics.Text({.stats = &stats});
  EXPECT_THAT(text, testing::HasSubstr("id=\"2\""));
  EXPECT_THAT(text, testing::Not(testing::HasSubstr("id=\"1\"")));
}

TEST(ServerReference, ListsEveryFlagWithItsDefault) {
  const char* argv[] = {"pliant-server", "--help"};
  testing::internal::CaptureStdout();
  ParseCommandLine(2, argv);
  const std::string help = testing::internal::GetCapturedStdout();
  const std::set<std::string> documented =
      FirstGroups(Section("flags.md", "Flags"), R"(\| `(--[a-z-]+)`)");
  std::set<std::string> offered = FirstGroups(help, R"(\n +(?:-h,)?(--[a-z-]+))");
  EXPECT_GT(offered.size(), 20U);
  EXPECT_EQ(documented, offered);
  const std::set<std::string> table =
      FirstGroups(Section("flags.md", "Flags"), R"(\| (`--[a-z-]+` \| [^|]* \|))");
  for (const std::string& line : table) {
    std::smatch parts;
    ASSERT_TRUE(std::regex_match(line, parts, std::regex(R"(`(--[a-z-]+)` \| (.*) \|)")));
    const std::string flag = parts[1];
    const std::string value = std::regex_replace(parts[2].str(), std::regex("`"), "");
    if (value == "-") continue;
    const std::size_t at = help.find("\n  " + flag + " ");
    ASSERT_NE(at, std::string::npos) << flag;
    const std::string in_help = help.substr(at, help.find("\n  -", at + 1) - at);
    const std::regex with_default("(=|\\[)" + value + "[ \\]\n]");  // CLI11 2.1, 2.4
    EXPECT_TRUE(std::regex_search(in_help, with_default))
        << in_help << " is documented as " << value;
  }
}

// Collects what `$ref` leads to, wherever it stands.
void CollectReferences(const Json& json, std::set<std::string>* found) {
  for (const auto& [name, value] : json.items()) {
    if (name == "$ref") found->insert(value.get<std::string>());
    if (value.is_structured()) CollectReferences(value, found);
  }
}

TEST(OpenApi, DescribesEveryRouteWithItsParametersAndCodes) {
  Service service(ServiceOptions{});
  const std::vector<Route> routes = MakeRoutes(service);
  const Json document = OpenApiDocument(routes);
  std::size_t operations = 0;
  std::set<std::string> codes_seen;
  for (const Route& route : routes) {
    if (route.name == "page" && route.pattern != "/") continue;
    if (route.scope == Scope::kPeer) {  // between servers
      codes_seen.merge(RouteCodes(route));
      continue;
    }
    SCOPED_TRACE(route.method + " " + route.pattern);
    std::string method = route.method;
    for (char& c : method) c = static_cast<char>(std::tolower(c));
    ASSERT_TRUE(document["paths"].contains(route.pattern));
    ASSERT_TRUE(document["paths"][route.pattern].contains(method));
    const Json& operation = document["paths"][route.pattern][method];
    EXPECT_FALSE(operation["summary"].get<std::string>().empty());
    EXPECT_FALSE(route.answers.empty());
    std::set<std::string> expected;
    for (const Parameter& parameter : route.parameters) {
      EXPECT_FALSE(parameter.meaning.empty()) << parameter.name;
      expected.insert(parameter.name);
    }
    std::set<std::string> documented;
    for (const Json& parameter : operation.value("parameters", Json::array())) {
      if (parameter["in"] == "query") documented.insert(parameter["name"].get<std::string>());
    }
    EXPECT_EQ(documented, expected);
    for (const std::string& code : RouteCodes(route)) {
      codes_seen.insert(code);
      const std::string status = std::to_string(ProblemCodeOf(code).status);
      EXPECT_THAT(operation["responses"][status].dump(), testing::HasSubstr("\"" + code + "\""))
          << code;
    }
    ++operations;
  }
  std::size_t in_document = 0;
  for (const auto& [path, methods] : document["paths"].items()) in_document += methods.size();
  EXPECT_EQ(in_document, operations);
  for (const ProblemCode& code : ProblemCodes()) {
    const std::string name = code.code;
    // Of no route, or of a job.
    const std::set<std::string> elsewhere = {"route_not_found", "method_not_allowed", "no_images",
                                             "interrupted"};
    if (elsewhere.contains(name)) continue;
    EXPECT_TRUE(codes_seen.contains(name)) << name << " is a code of no route";
  }
  for (const Json& tag : document["tags"]) {
    EXPECT_NE(tag["name"], tag["description"]) << "openapi/document.cc does not say what it means";
  }
  std::set<std::string> references;
  CollectReferences(document, &references);
  EXPECT_GT(references.size(), 10U);
  for (const std::string& reference : references) {
    EXPECT_TRUE(document.contains(Json::json_pointer(reference.substr(1)))) << reference;
  }
}

TEST(ServerOptions, ReadsFlagsEnvironmentAndFile) {
  const std::string file = testing::TempDir() + "pliant-server-test.toml";
  std::ofstream(file)
      << "queue-length = 7\nhttp-threads = 9\nmax-body-mb = 3\nauto-train = false\n";
  setenv("PLIANT_HTTP_THREADS", "11", 1);
  const char* argv[] = {"pliant-server", "--db",           "x.db", "--config",
                        file.c_str(),    "--max-body-mb",  "5",    "--fetch-hosts",
                        "a.b,*.c.d",     "--idle-timeout", "7"};
  const ParsedCommandLine parsed = ParseCommandLine(11, argv);
  unsetenv("PLIANT_HTTP_THREADS");
  ASSERT_FALSE(parsed.finished);
  EXPECT_EQ(parsed.options.service.pool.queue_length, 7);
  EXPECT_FALSE(parsed.options.service.auto_train);
  EXPECT_TRUE(parsed.options.service.engine.keep_originals);
  EXPECT_EQ(parsed.options.http.threads, 11) << "the environment comes before the file";
  EXPECT_EQ(parsed.options.http.max_body_bytes, 5U << 20) << "a flag comes before the file";
  EXPECT_THAT(parsed.options.service.fetch.hosts, testing::ElementsAre("a.b", "*.c.d"));
  EXPECT_EQ(parsed.options.http.idle_timeout, std::chrono::seconds(7));
}

TEST(ServerOptions, AnEmptyVariableIsAnEmptyValue) {
  setenv("PLIANT_IMPORT_DIR", "", 1);
  setenv("PLIANT_MODEL", "", 1);
  setenv("PLIANT_KEEP_ORIGINALS", "false", 1);
  const char* argv[] = {"pliant-server", "--db", "x.db"};
  const ParsedCommandLine parsed = ParseCommandLine(3, argv);
  for (const char* name : {"PLIANT_IMPORT_DIR", "PLIANT_MODEL", "PLIANT_KEEP_ORIGINALS"}) {
    unsetenv(name);
  }
  ASSERT_FALSE(parsed.finished);
  EXPECT_EQ(parsed.options.service.import_dir, "");
  EXPECT_EQ(parsed.options.service.engine.descriptor_options.model_path, "");
  EXPECT_FALSE(parsed.options.service.engine.keep_originals);
}

TEST(ServerOptions, PrintsWhatIsInForceAndReadsItAgain) {
  const auto print = [](std::vector<const char*> arguments) {
    arguments.insert(arguments.begin(), "pliant-server");
    arguments.push_back("--print-config");
    testing::internal::CaptureStdout();
    const auto parsed = ParseCommandLine(static_cast<int>(arguments.size()), arguments.data());
    EXPECT_TRUE(parsed.finished);
    EXPECT_EQ(parsed.exit_status, 0);
    return testing::internal::GetCapturedStdout();
  };
  const std::string first =
      print({"--db", "a \"b\".db", "--queue-length", "7", "--auto-train", "false"});
  EXPECT_THAT(first, testing::HasSubstr("queue-length = 7\n"));
  EXPECT_THAT(first, testing::HasSubstr("auto-train = false\n"));
  EXPECT_THAT(first, testing::HasSubstr("listen = \"127.0.0.1:8080\"\n"));
  const std::string file = testing::TempDir() + "pliant-server-printed.toml";
  std::ofstream(file) << first;
  EXPECT_EQ(print({"--config", file.c_str()}), first);
}

TEST(ServerOptions, RefusesWhatCannotBeMeant) {
  ServerOptions good;
  good.http.allowed_origins = {"https://a.example", "http://localhost:3000"};
  EXPECT_NO_THROW(CheckOptions(good));
  for (const char* origins : {"a.example", "https://a.example/", "https://a.example/x", "null"}) {
    ServerOptions options;
    options.http.allowed_origins = {origins};
    EXPECT_THROW(CheckOptions(options), Error) << origins;
  }
  ServerOptions directory;
  directory.service.backup_dir = "/nowhere";
  EXPECT_THROW(CheckOptions(directory), Error);
  ServerOptions half;
  half.http.tls_certificate = "cert.pem";
  EXPECT_THROW(CheckOptions(half), Error);
}

TEST(ServerOptions, KeepsToLoopbackUnlessTold) {
  ServerOptions options;
  for (const char* listen : {"127.0.0.1:0", "127.1.2.3:80", "localhost:8080", "[::1]:1"}) {
    options.listen = listen;
    EXPECT_NO_THROW(CheckExposure(options, false)) << listen;
    EXPECT_TRUE(OpenWithoutKeys(options)) << listen;
  }
  options.listen = "0.0.0.0:8080";
  EXPECT_THROW(CheckExposure(options, false), Error);
  EXPECT_NO_THROW(CheckExposure(options, true));
  EXPECT_FALSE(OpenWithoutKeys(options));
  options.allow_anonymous = true;
  EXPECT_NO_THROW(CheckExposure(options, false));
  for (const char* listen : {"", "8080", ":8080", "host:", "host:x", "host:70000", "host:-1"}) {
    options.listen = listen;
    EXPECT_THROW(MakeHttpOptions(options), Error) << listen;
  }
}

}  // namespace
}  // namespace pliant::server
