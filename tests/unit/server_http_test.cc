// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Router and parameters, without a socket.
#include <random>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/http/form.h"
#include "server/http/parameters.h"
#include "server/http/problem.h"
#include "server/http/router.h"
#include "tests/unit/problem_of.h"

namespace pliant::server {
namespace {

Response Empty(const Request&, const Parameters&) { return {}; }

Router TestRouter() {
  return Router({{.name = "a", .method = "GET", .pattern = "/x", .handler = Empty},
                 {.name = "b", .method = "POST", .pattern = "/x", .handler = Empty},
                 {.name = "c", .method = "GET", .pattern = "/x/{id}", .handler = Empty},
                 {.name = "d", .method = "DELETE", .pattern = "/x/{id}/y/{z}", .handler = Empty}});
}

Request RequestFor(const std::string& method, const std::string& path) {
  Request request;
  request.method = method;
  request.segments = SplitPath(path);
  return request;
}

TEST(Router, ResolvesAndCaptures) {
  const Router router = TestRouter();
  Request request = RequestFor("DELETE", "/x/a%2Fb/y/%C3%BC");
  EXPECT_EQ(router.Resolve(request).name, "d");
  EXPECT_EQ(request.captures, (std::map<std::string, std::string>{{"id", "a/b"}, {"z", "ü"}}));
  Request get = RequestFor("GET", "/x");
  EXPECT_EQ(router.Resolve(get).name, "a");
}

TEST(Router, SaysWhatIsWrong) {
  const Router router = TestRouter();
  const auto resolve = [&](const std::string& method, const std::string& path) {
    Request request = RequestFor(method, path);
    router.Resolve(request);
  };
  for (const std::string path : {"/", "/y", "/x/", "/x/1/y", "/x/1/y/", "/x/1/y/2/"}) {
    EXPECT_EQ(ProblemOf([&] { resolve("GET", path); }).code, "route_not_found") << path;
  }
  const Problem problem = ProblemOf([&] { resolve("PUT", "/x"); });
  EXPECT_EQ(problem.status, 405);
  EXPECT_EQ(problem.allow, "GET, HEAD, POST");
  EXPECT_THROW(Router({{.name = "a", .method = "GET", .pattern = "/x", .handler = Empty},
                       {.name = "b", .method = "GET", .pattern = "/x", .handler = Empty}}),
               std::logic_error);
}

TEST(Router, PathsRoundTrip) {
  std::mt19937 random(3);
  for (int i = 0; i < 200; ++i) {
    std::string text;
    for (std::size_t n = random() % 20 + 1; n > 0; --n) text += static_cast<char>(random() % 128);
    EXPECT_EQ(SplitPath("/" + EncodeSegment(text)), std::vector<std::string>{text});
  }
  for (const std::string path : {"", "x", "/%", "/%1", "/%g1", "/%ff", "/%c0%80"}) {
    EXPECT_EQ(ProblemOf([&] { SplitPath(path); }).code, "bad_request") << path;
  }
}

class ParametersTest : public testing::Test {
 protected:
  Parameters Make() { return {route_, request_}; }
  void Ask(const std::string& name) {
    request_.query = {{"must", "x"}};
    (void)Make().Get<std::int64_t>(name);
  }

  Route route_{
      .name = "t",
      .method = "POST",
      .pattern = "/t",
      .parameters = {Parameter("n", "").Integer(1, 9), Parameter("x", "").Number(0, 1),
                     Parameter("list", "").Numbers(2), Parameter("kind", "").Choice({"a", "b"}),
                     Parameter("meta", "").Json(), Parameter("items", "").JsonList(),
                     Parameter("on", "").Boolean(), Parameter("text", "")},
      .handler = Empty};
  Request request_;
};

TEST_F(ParametersTest, ReadsQueryFormAndJsonAlike) {
  request_.query = {{"n", "5"}};
  EXPECT_EQ(Make().Get<std::int64_t>("n"), 5);
  request_.query.clear();
  request_.content_type = "multipart/form-data";
  request_.parts = {{"image", "", "", "image"}, {"n", "", "", "6"}};
  EXPECT_EQ(Make().Get<std::int64_t>("n"), 6);
  request_.parts.clear();
  request_.content_type = "application/json";
  request_.body = R"({"n": 7, "list": [1, 2.5], "kind": "b", "meta": {"a": {"b": 1}}, "x": null,
                       "items": [{}, 1], "on": true})";
  const Parameters json = Make();
  EXPECT_EQ(json.Get<std::int64_t>("n"), 7);
  EXPECT_EQ(json.Get<std::vector<double>>("list"), (std::vector<double>{1, 2.5}));
  EXPECT_EQ((json.Choice<int>("kind", {{"a", 1}, {"b", 2}})), 2);
  EXPECT_EQ(json.Text("meta"), R"({"a":{"b":1}})");
  EXPECT_EQ(json.Get<Json>("items")->size(), 2U);
  EXPECT_EQ(json.Get<bool>("on"), true);
  EXPECT_FALSE(json.has("x"));
  EXPECT_EQ(json.Get<double>("x"), std::nullopt);
}

TEST_F(ParametersTest, TakesNoJsonTypeForAnother) {
  request_.content_type = "application/json";
  const auto refused = [&](const std::string& name, const std::string& value) {
    request_.body = "{\"" + name + "\": " + value + "}";
    const Problem problem = ProblemOf([&] { Make(); });
    return problem.code == "invalid_parameter" && problem.parameter == name;
  };
  const std::map<std::string, std::vector<std::string>> wrong = {
      {"n",
       {R"("5")", "1.5", "true", "[]", "[5]", "{}", "0", "10", "1e300", "18446744073709551615"}},
      {"x", {R"("0.5")", "false", "[]", "{}", "2"}},
      {"list", {R"("1,2")", "1", "{}", R"([1, "2"])", "[1, null]", "[]", "[1]", "[[1], 2]"}},
      {"kind", {"1", "true", R"(["a"])", "{}", R"("c")"}},
      {"meta", {R"("{}")", "[]", "1", "true"}},
      {"items", {R"("[]")", "{}", "1"}},
      {"on", {R"("true")", "1", "[]", "{}"}},
      {"text", {"[]", "{}", "5", "1.5", "true"}}};
  for (const auto& [name, values] : wrong) {
    for (const std::string& value : values) EXPECT_TRUE(refused(name, value)) << name << value;
  }
  request_.body = R"({"n": 5.0, "x": 1, "list": [-1.5, 2], "on": false, "text": "5"})";
  EXPECT_EQ(Make().Get<std::int64_t>("n"), 5);
  EXPECT_EQ(Make().Get<double>("x"), 1);
  EXPECT_EQ(Make().Get<bool>("on"), false);
  EXPECT_EQ(Make().Text("text"), "5");
  request_.body = R"({"q": null})";
  EXPECT_EQ(ProblemOf([&] { Make(); }).code, "unknown_parameter") << "also without a value";
  for (const char* twice : {R"({"n": 1, "n": 1})", R"({"meta": {"a": 1, "a": 2}})",
                            R"({"items": [{"b": {}}, {"b": 0, "c": 1, "b": 0}]})"}) {
    request_.body = twice;
    EXPECT_EQ(ProblemOf([&] { Make(); }).code, "invalid_json") << twice;
  }
  request_.body = R"({"items": [{"b": {"b": 1}}, {"b": 0}]})";
  EXPECT_EQ(Make().Get<Json>("items")->size(), 2U);
}

TEST_F(ParametersTest, NamesWhatIsWrong) {
  const auto code_for = [&](const std::string& name, const std::string& value) {
    request_.query = {{name, value}};
    const Problem problem = ProblemOf([&] { Make(); });
    return problem.parameter == name ? problem.code : "parameter not named: " + problem.parameter;
  };
  for (const char* value : {"", "0", "10", "5x", " 5", "5 ", "+5", "5.0", "99999999999999999999"}) {
    EXPECT_EQ(code_for("n", value), "invalid_parameter") << value;
  }
  for (const char* value : {"", "-0.1", "1.1", "nan", "inf", "0,5"}) {
    EXPECT_EQ(code_for("x", value), "invalid_parameter") << value;
  }
  for (const char* value : {"", "1", "1,", ",1", "1,2,3", "1,nan", "1;2"}) {
    EXPECT_EQ(code_for("list", value), "invalid_parameter") << value;
  }
  for (const char* value : {"", "c", "A"}) {
    EXPECT_EQ(code_for("kind", value), "invalid_parameter") << value;
  }
  EXPECT_EQ(code_for("on", "1"), "invalid_parameter");
  EXPECT_EQ(code_for("meta", "[]"), "invalid_json");
  EXPECT_EQ(code_for("items", "{}"), "invalid_json");
  EXPECT_EQ(code_for("n", "\xff"), "invalid_parameter");
  request_.query = {{"n", "1"}, {"n", "1"}};
  EXPECT_EQ(ProblemOf([&] { Make(); }).code, "duplicate_parameter");
  request_.query = {{"q", "1"}};
  EXPECT_EQ(ProblemOf([&] { Make(); }).code, "unknown_parameter");
  request_.query.clear();
  route_.parameters.push_back(Parameter("must", "").Required());
  EXPECT_EQ(ProblemOf([&] { Make(); }).code, "missing_parameter");
  EXPECT_THROW(Ask("other"), std::logic_error) << "a handler asks for what the route does not list";
  EXPECT_THROW(Ask("must"), Json::type_error) << "a handler asks for another type";
}

TEST(Query, IsDecoded) {
  using Values = std::multimap<std::string, std::string>;
  EXPECT_EQ(ParseQuery(""), Values());
  EXPECT_EQ(
      ParseQuery("a=1&b=x+y%20z%C3%A9&&a=1&c&=d&e=f=g"),
      (Values{{"a", "1"}, {"a", "1"}, {"b", "x y z\xc3\xa9"}, {"c", ""}, {"", "d"}, {"e", "f=g"}}));
  EXPECT_EQ(ParseQuery("a=100%&b=%zz%4&c=%e9"),
            (Values{{"a", "100%"}, {"b", "%zz%4"}, {"c", "\xe9"}}));
}

constexpr const char* kFile = "name=\"image\"; filename=\"a.jpg\"";

std::string FormWith(const std::string& disposition, const std::string& content = "bytes") {
  return "--B\r\nContent-Disposition: form-data; " + disposition + "\r\n\r\n" + content +
         "\r\n--B--\r\n";
}

TEST(Form, ReadsParts) {
  const std::string body =
      "--B\r\nContent-Disposition: form-data; name=\"image\"; filename=\"a;b \\\"c\\\".png\"\r\n"
      "content-type: image/png\r\n\r\n"
      "\r\n--C"
      "\r\n--B  \r\nContent-Disposition: Form-Data; name=object\r\n\r\n"
      "\r\n--B--\r\nwhat follows";
  for (const char* type :
       {"multipart/form-data; boundary=B", "Multipart/Form-Data;BOUNDARY=\"B\"",
        "multipart/form-data; x=\"boundary=;\"; boundary=B; charset=utf-8",
        "multipart/form-data;boundary=B;charset=utf-8", "multipart/form-data; x; boundary = B"}) {
    const std::vector<Part> parts = ParseForm(type, body, 2);
    ASSERT_EQ(parts.size(), 2U);
    EXPECT_EQ(parts[0].name, "image");
    EXPECT_EQ(parts[0].filename, R"(a;b "c".png)");
    EXPECT_EQ(parts[0].content_type, "image/png");
    EXPECT_EQ(parts[0].content, "\r\n--C");
    EXPECT_EQ(parts[1].name, "object");
    EXPECT_EQ(parts[1].content, "");
  }
}

// One part, in the shapes that clients send it.
TEST(Form, ReadsTheFormsOfAllClients) {
  const std::string plain = FormWith(kFile);
  for (const std::string& body : {
           plain,
           FormWith("name=image; filename=a.jpg; filename*=utf-8''a.jpg"),  // .NET
           FormWith("filename=\"a.jpg\"; name=\"image\""),
           FormWith("NAME=\"image\" ;FileName=a.jpg"),
           FormWith("name=image; filename=\"=?utf-8?B?YQ==?=\"; filename*=UTF-8'en'a%2Ejpg"),
           FormWith("name=\"image\";\r\n\tfilename=\"a.jpg\""),  // folded
           plain.substr(0, plain.size() - 2),                    // Node 18
           "\r\n" + plain,
           "This is a multipart message.\r\n" + plain,
           "--B \t" + plain.substr(3, plain.size() - 5) + " \r\n",
       }) {
    const std::vector<Part> parts = ParseForm("x; boundary=B", body, 1);
    ASSERT_EQ(parts.size(), 1U) << body;
    EXPECT_EQ(parts[0].name, "image") << body;
    EXPECT_EQ(parts[0].filename, "a.jpg") << body;
    EXPECT_EQ(parts[0].content, "bytes") << body;
  }
  const auto filename = [](const std::string& text) {
    return ParseForm("x; boundary=B", FormWith("name=image; " + text), 1).at(0).filename;
  };
  EXPECT_EQ(filename(R"(filename="C:\new\photo.jpg")"), R"(C:\new\photo.jpg)");
  EXPECT_EQ(filename(R"(filename="a\\b.jpg")"), R"(a\b.jpg)");
  EXPECT_EQ(filename("filename*=utf-8''caf%C3%A9.jpg; filename=x"), "caf\xc3\xa9.jpg");
  EXPECT_EQ(filename("filename*=latin1''caf%E9.jpg; filename=x"), "x");
}

TEST(Form, SaysWhatIsWrong) {
  const auto wrong = [](const std::string& body, const std::string& type = "x; boundary=B") {
    const Problem problem = ProblemOf([&] { ParseForm(type, body, 2); });
    EXPECT_TRUE(problem.code.empty() || problem.code == "bad_request") << problem.code;
    return problem.detail;
  };
  const std::string part = "--B\r\nContent-Disposition: form-data; name=\"a\"\r\n\r\n";
  const std::string whole = part + "x\r\n--B--\r\n";
  EXPECT_EQ(wrong(whole), "");
  for (std::size_t size = 0; size < whole.size() - 4; ++size) {
    EXPECT_NE(wrong(whole.substr(0, size)), "") << size;
  }
  using testing::HasSubstr;
  EXPECT_THAT(wrong("--B--\r\n"), HasSubstr("no parts"));
  EXPECT_THAT(wrong(whole, "x"), HasSubstr("Content-Type has no boundary"));
  EXPECT_THAT(wrong(whole, "x; boundary="), HasSubstr("Content-Type has no boundary"));
  EXPECT_THAT(wrong(whole, "x; boundary=" + std::string(71, 'B')), HasSubstr("more than 70 bytes"));
  EXPECT_THAT(wrong(whole, "x; boundary=C"), HasSubstr("begins with the boundary, --C"));
  EXPECT_THAT(wrong("--B\r\nX: y\r\n\r\nx\r\n--B--"), HasSubstr("part 1 has no name"));
  EXPECT_THAT(wrong("--B\r\nX\r\n\r\nx\r\n--B--"), HasSubstr("has no colon"));
  EXPECT_THAT(wrong("--B\nContent-Disposition: form-data; name=a\n\nx\n--B--"), HasSubstr("CR LF"));
  EXPECT_THAT(wrong("--Bx" + whole), HasSubstr("followed by other text"));
  EXPECT_THAT(wrong(part + "x"), HasSubstr("part \"a\" has no end. After the last part, --B--"));
  EXPECT_THAT(wrong(part + "\r\n" + part + "\r\n" + part + "\r\n--B--"),
              HasSubstr("more than 2 parts"));
  EXPECT_THAT(wrong(FormWith("name=image\r\nContent-Transfer-Encoding: Base64")),
              HasSubstr("base64"));
  EXPECT_EQ(wrong(FormWith("name=image\r\nContent-Transfer-Encoding: binary")), "");
}

TEST_F(ParametersTest, GuessesWhatWasMeant) {
  route_.body = BodyKind::kImageOrJson;
  const auto detail = [&](const Part& part) {
    request_.parts = {part};
    return ProblemOf([&] { Make(); }).detail;
  };
  const std::string image = "did you mean the part \"image\"?";
  EXPECT_THAT(detail({"file", "a.jpg", "", "x"}), testing::HasSubstr(image));
  EXPECT_THAT(detail({"photo", "", "image/png", "x"}), testing::HasSubstr(image));
  const std::string large(70'000, 'x');
  EXPECT_THAT(detail({"file", "", "", large}), testing::HasSubstr(image));
  EXPECT_THAT(detail({"kinds", "", "", "x"}), testing::HasSubstr("did you mean kind?"));
  EXPECT_THAT(detail({"q", "", "", "x"}), testing::HasSubstr("\"q\". This route takes image, n, "));
  request_.parts = {{"text", "", "", large}};
  EXPECT_EQ(ProblemOf([&] { Make(); }).code, "body_too_large");
}

TEST(Problem, MapsEveryErrorCodeAndHidesWhatIsInternal) {
  const std::vector<std::pair<ErrorCode, int>> statuses = {{ErrorCode::kInvalidArgument, 400},
                                                           {ErrorCode::kNotFound, 404},
                                                           {ErrorCode::kConflict, 409},
                                                           {ErrorCode::kCorrupt, 500},
                                                           {ErrorCode::kUnsupportedMediaType, 415},
                                                           {ErrorCode::kTooLarge, 413},
                                                           {ErrorCode::kUnprocessable, 422},
                                                           {ErrorCode::kUnavailable, 503},
                                                           {ErrorCode::kNoSpace, 507},
                                                           {ErrorCode::kReadOnly, 500},
                                                           {ErrorCode::kCancelled, 503},
                                                           {ErrorCode::kInternal, 500}};
  for (const auto& [code, status] : statuses) {
    Problem problem;
    try {
      throw Error(code, "some_reason", "secret /path");
    } catch (...) {
      problem = CurrentProblem();
    }
    EXPECT_EQ(problem.status, status);
    const Response response = ProblemResponse(problem, "id");
    const bool tells = response.body.find("secret") != std::string::npos;
    EXPECT_EQ(tells, status < 500) << response.body;
    if (status < 500) {
      EXPECT_EQ(problem.code, "some_reason");
    } else {
      EXPECT_THAT(problem.internal, testing::HasSubstr("secret"));
    }
    EXPECT_EQ(problem.retry_after_s > 0, status == 503);
  }
  EXPECT_THROW(ProblemError("no_such_code", "x"), std::logic_error);
  try {
    throw Error(ErrorCode::kInvalidArgument, "min_score_invalid", "min_score must be 0 to 1");
  } catch (...) {
    EXPECT_EQ(CurrentProblem().code, "invalid_parameter");
    EXPECT_EQ(CurrentProblem().parameter, "min_score");
  }
}

// The document promises the declared default, so a handler must get it, too.
TEST(Parameters, AnAbsentValueIsTheDeclaredDefault) {
  const Route route{.name = "x",
                    .method = "GET",
                    .pattern = "/x",
                    .parameters = {Parameter("limit", "").Integer(1, 9).Default("5"),
                                   Parameter("deep", "").Boolean().Default("true"),
                                   Parameter("share", "").Number(0, 1).Default("0.5"),
                                   Parameter("kind", "").Choice({"a", "b"}).Default("b")},
                    .handler = Empty};
  Request request;
  const Parameters none(route, request);
  EXPECT_EQ(none.Value<int>("limit"), 5);
  EXPECT_TRUE(none.Value<bool>("deep"));
  EXPECT_EQ(none.Value<double>("share"), 0.5);
  EXPECT_EQ(none.Value<std::string>("kind"), "b");
  EXPECT_FALSE(none.has("limit"));
  request.query = {{"limit", "7"}, {"deep", "false"}, {"share", "1"}, {"kind", "a"}};
  const Parameters all(route, request);
  EXPECT_EQ(all.Value<std::size_t>("limit"), 7U);
  EXPECT_FALSE(all.Value<bool>("deep"));
  EXPECT_EQ(all.Value<double>("share"), 1);
  EXPECT_EQ(all.Value<std::string>("kind"), "a");
}

}  // namespace
}  // namespace pliant::server
