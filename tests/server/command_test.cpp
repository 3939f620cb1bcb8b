// What a page may send, and what it may not.
#include <gtest/gtest.h>

#include "server/command.hpp"

namespace fork1s {
namespace {

TEST(Command, ReadsAPull) {
  const auto c = ParseCommand(R"({"type":"pull","body":3,"point":[0,0.1,0],"target":[1,2,3.5]})");
  ASSERT_TRUE(c) << c.error().Text();
  EXPECT_EQ(c->kind, Command::Kind::kPull);
  EXPECT_EQ(c->body, 3);
  EXPECT_EQ(c->point, Vector3(0, 0.1, 0));
  EXPECT_EQ(c->target, Vector3(1, 2, 3.5));
}

TEST(Command, ReadsTheOthers) {
  EXPECT_EQ(ParseCommand(R"({"type":"pause","on":true})")->on, true);
  EXPECT_EQ(ParseCommand(R"({"type":"step"})")->kind, Command::Kind::kStep);
  EXPECT_EQ(ParseCommand(R"({"type":"set","setting":"control","index":2,"value":0.5})")->value, 0.5);
  const auto c = ParseCommand(R"({"type":"interfaces","mechanism":1,"bodies":[4,7]})");
  EXPECT_EQ(c->bodies, (std::vector<int>{4, 7}));
  EXPECT_EQ(c->index, 1);
}

class Refused : public testing::TestWithParam<const char*> {};

TEST_P(Refused, SaysWhy) {
  const auto c = ParseCommand(GetParam());
  ASSERT_FALSE(c);
  EXPECT_EQ(c.error().code, ErrorCode::kFormat);
  EXPECT_GT(c.error().message.size(), 10u);
  EXPECT_LT(c.error().message.size(), 120u);  // what the reason of a WebSocket close has room for
}

INSTANTIATE_TEST_SUITE_P(Messages, Refused,
                         testing::Values("", "{", "null", "[]", "7", R"("pull")", R"({"type":null})",
                                         R"({"type":"fly"})", R"({"type":"left"})", R"({"type":"pull"})",
                                         R"({"type":"pull","body":1,"point":[0,0]})",
                                         R"({"type":"pull","body":1.5,"point":[0,0,0],"target":[0,0,0]})",
                                         R"({"type":"pull","body":1,"point":[0,0,NaN],"target":[0,0,0]})",
                                         R"({"type":"pull","body":1,"point":[0,0,null],"target":[0,0,0]})",
                                         R"({"type":"pull","body":1,"point":[0,0,1e999],"target":[0,0,0]})",
                                         R"({"type":"pull","body":1,"point":[0,0,"1"],"target":[0,0,0]})",
                                         R"({"type":"pull","body":4e10,"point":[0,0,0],"target":[0,0,0]})",
                                         R"({"type":"pause","on":1})", R"({"type":"set","value":1})",
                                         R"({"type":"set","setting":"dt","value":1e300})",
                                         R"({"type":"set","setting":5,"value":1})",
                                         R"({"type":"interfaces","mechanism":0,"bodies":{}})", "\xff\xfe",
                                         R"({"type":"step"} {"type":"step"})"));

TEST(Command, NestingHasABottom) {
  EXPECT_FALSE(ParseCommand(std::string(30000, '[')));
  EXPECT_FALSE(ParseCommand(R"({"type":"interfaces","mechanism":0,"bodies":)" + std::string(20000, '[') +
                            std::string(20000, ']') + "}"));
}

TEST(Command, ListsHaveAnEnd) {
  std::string many = R"({"type":"interfaces","mechanism":0,"bodies":[0)";
  for (int i = 0; i < 5000; ++i) many += ",1";
  EXPECT_FALSE(ParseCommand(many + "]}"));
}

}  // namespace
}  // namespace fork1s
