#include "sim/modbus/modbus_server.h"

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "tests/sim/tcp_peer.h"

namespace eigenpose::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr int nothing_comes_ms =
    150;  // silence can only be shown by waiting; the server answers within 20 ms

const Bytes read_output{0x12, 0x34, 0, 0, 0, 6, 1, 0x03, 0x00, 0x7E, 0, 2};
const Bytes output_answer{0x12, 0x34, 0, 0, 0, 7, 1, 0x03, 4, 0, 0, 0x40, 0x20};  // READY and IN-POS

struct ModbusServer : testing::Test {
  ManualClock clock{TimePoint(seconds(500))};
  SimLab lab{clock};
  SimModbusServer server{lab, {}};
  TcpPeer peer{server.port()};
};

TEST_F(ModbusServer, AnswersAReadByteForByte) {
  EXPECT_EQ(peer.ask(read_output, 13), output_answer);
}

TEST_F(ModbusServer, EchoesASingleWrite) {
  const Bytes request{0, 1, 0, 0, 0, 6, 1, 0x06, 0x00, 0x5D, 0x03, 0xE8};
  EXPECT_EQ(peer.ask(request, 12), request);
  EXPECT_EQ(peer.ask({0, 2, 0, 0, 0, 6, 1, 0x03, 0x00, 0x5D, 0, 1}, 11),
            (Bytes{0, 2, 0, 0, 0, 5, 1, 0x03, 2, 0x03, 0xE8}));
}

TEST_F(ModbusServer, ConfirmsAMultipleWriteAndMoves) {
  // ZHOME first, then a direct data operation of 100 steps.
  EXPECT_EQ(peer.ask({0, 1, 0, 0, 0, 11, 1, 0x10, 0x00, 0x7C, 0, 2, 4, 0, 0, 0, 0x10}, 12),
            (Bytes{0, 1, 0, 0, 0, 6, 1, 0x10, 0x00, 0x7C, 0, 2}));
  EXPECT_EQ(peer.ask({0, 2,    0,    0, 0, 39,   1,    0x10, 0x00, 0x58, 0,    16, 32,   0,    0,
                      0, 0,    0,    0, 0, 1,    0,    0,    0,    100,  0,    0,  0x23, 0x28, 0,
                      0, 0x8C, 0xA0, 0, 0, 0x8C, 0xA0, 0,    0,    0x03, 0xE8, 0,  0,    0,    1},
                     12),
            (Bytes{0, 2, 0, 0, 0, 6, 1, 0x10, 0x00, 0x58, 0, 16}));
  clock.advance(seconds(1));
  EXPECT_EQ(peer.ask({0, 3, 0, 0, 0, 6, 1, 0x03, 0x00, 0xCC, 0, 2}, 13),
            (Bytes{0, 3, 0, 0, 0, 7, 1, 0x03, 4, 0, 0, 0, 100}));
  EXPECT_NEAR(lab.truth().table.degrees(), 1.0, 1e-9);
}

TEST_F(ModbusServer, WritesBeforeItReadsInAnExchange) {
  EXPECT_EQ(peer.ask({0, 1, 0, 0, 0, 13, 1, 0x17, 0x00, 0x5D, 0, 1, 0x00, 0x5D, 0, 1, 2, 0x01, 0x23}, 11),
            (Bytes{0, 1, 0, 0, 0, 5, 1, 0x17, 2, 0x01, 0x23}));
}

TEST_F(ModbusServer, EchoesADiagnosticQuery) {
  const Bytes request{0, 9, 0, 0, 0, 6, 2, 0x08, 0, 0, 0xA5, 0x37};
  EXPECT_EQ(peer.ask(request, 12), request);
}

TEST_F(ModbusServer, MalformedRequestsGetTheirException) {
  struct Case {
    Bytes pdu;
    Bytes answer;
  };
  const Case cases[] = {
      {{0x01, 0, 0, 0, 1}, {0x81, 1}},                       // coils are not served
      {{0x03, 0x00, 0x7E, 0, 0}, {0x83, 3}},                 // no register
      {{0x03, 0x00, 0x7E, 0, 126}, {0x83, 3}},               // too many
      {{0x03, 0x00, 0x7E, 0}, {0x83, 3}},                    // cut short
      {{0x03, 0x00, 0x82, 0, 1}, {0x83, 2}},                 // no such address
      {{0x03, 0xFF, 0xFF, 0, 2}, {0x83, 2}},                 // past the end
      {{0x06, 0x00, 0x7F, 0, 1}, {0x86, 2}},                 // read only
      {{0x10, 0x00, 0x7C, 0, 2, 3, 0, 0, 0}, {0x90, 3}},     // byte count wrong
      {{0x10, 0x00, 0x7C, 0, 2, 4, 0, 0}, {0x90, 3}},        // data cut short
      {{0x10, 0x00, 0x7C, 0, 2, 4, 0, 0, 0, 8}, {0x90, 4}},  // START of stored data: refused
      {{0x17, 0x00}, {0x97, 3}},
      {{0x08, 0, 1, 0, 0}, {0x88, 3}},
  };
  for (const Case& example : cases) {
    Bytes request{7, 7, 0, 0, 0, static_cast<std::uint8_t>(example.pdu.size() + 1), 1};
    request.insert(request.end(), example.pdu.begin(), example.pdu.end());
    Bytes answer{7, 7, 0, 0, 0, 3, 1};
    answer.insert(answer.end(), example.answer.begin(), example.answer.end());
    EXPECT_EQ(peer.ask(request, answer.size()), answer) << "function " << int(example.pdu[0]);
  }
}

TEST_F(ModbusServer, TheGatewayAnswersForAUnitThatNobodyHas) {
  EXPECT_EQ(peer.ask({0, 1, 0, 0, 0, 6, 99, 0x03, 0, 0x7E, 0, 1}, 9),
            (Bytes{0, 1, 0, 0, 0, 3, 99, 0x83, 0x0B}));
  server.drive(2).set_faults({.dead = true});
  EXPECT_EQ(peer.ask({0, 2, 0, 0, 0, 6, 2, 0x03, 0, 0x7E, 0, 1}, 9),
            (Bytes{0, 2, 0, 0, 0, 3, 2, 0x83, 0x0B}));
}

TEST_F(ModbusServer, AnotherProtocolIsIgnoredAndAnImpossibleLengthEndsTheConnection) {
  peer.send({0, 1, 0, 5, 0, 6, 1, 0x03, 0, 0x7E, 0, 2});
  EXPECT_EQ(peer.ask(read_output, 13), output_answer);
  peer.send({0, 1, 0, 0, 0xFF, 0xFF, 1, 3});
  EXPECT_TRUE(peer.closed());
}

TEST_F(ModbusServer, ABroadcastIsObeyedInSilence) {
  peer.send({0, 1, 0, 0, 0, 6, 0, 0x06, 0x00, 0x5D, 0, 77});
  for (const std::uint8_t unit : {1, 2, 3}) {
    EXPECT_EQ(peer.ask({0, 2, 0, 0, 0, 6, unit, 0x03, 0x00, 0x5D, 0, 1}, 11),
              (Bytes{0, 2, 0, 0, 0, 5, unit, 0x03, 2, 0, 77}));
  }
}

TEST_F(ModbusServer, RequestsMayComeInPiecesOrTogether) {
  peer.send({read_output.begin(), read_output.begin() + 5});
  peer.send({read_output.begin() + 5, read_output.end()});
  EXPECT_EQ(peer.receive(13), output_answer);
  Bytes both = read_output;
  both.insert(both.end(), read_output.begin(), read_output.end());
  Bytes answers = output_answer;
  answers.insert(answers.end(), output_answer.begin(), output_answer.end());
  EXPECT_EQ(peer.ask(both, 26), answers);
}

TEST_F(ModbusServer, FaultsComeInTheirOrderAndThenItIsWellAgain) {
  server.faults().add({.kind = WireFaultKind::silence});
  server.faults().add({.kind = WireFaultKind::partial});
  server.faults().add({.kind = WireFaultKind::wrong_unit});
  server.faults().add({.kind = WireFaultKind::wrong_transaction});
  server.faults().add({.kind = WireFaultKind::exception, .exception_code = 6});
  peer.send(read_output);
  EXPECT_TRUE(peer.receive(1, nothing_comes_ms).empty());
  EXPECT_EQ(peer.ask(read_output, 6), Bytes(output_answer.begin(), output_answer.begin() + 6));
  EXPECT_TRUE(peer.receive(1, nothing_comes_ms).empty());
  Bytes wrong = output_answer;
  wrong[6] = 2;
  EXPECT_EQ(peer.ask(read_output, 13), wrong);
  wrong = output_answer;
  wrong[1] = 0x35;
  EXPECT_EQ(peer.ask(read_output, 13), wrong);
  EXPECT_EQ(peer.ask(read_output, 9), (Bytes{0x12, 0x34, 0, 0, 0, 3, 1, 0x83, 6}));
  EXPECT_EQ(peer.ask(read_output, 13), output_answer);
  EXPECT_EQ(server.faults().count(), 5U);
}

TEST_F(ModbusServer, ALateAnswerComesWhenItsTimeHasCome) {
  server.faults().add({.kind = WireFaultKind::late, .delay = milliseconds(400)});
  peer.send(read_output);
  EXPECT_TRUE(peer.receive(1, nothing_comes_ms).empty());
  clock.advance(milliseconds(399));
  EXPECT_TRUE(peer.receive(1, nothing_comes_ms).empty());
  clock.advance(milliseconds(2));
  EXPECT_EQ(peer.receive(13), output_answer);
}

TEST_F(ModbusServer, ALostRequestIsNotObeyedASilentOneIs) {
  server.faults().add({.kind = WireFaultKind::loss});
  peer.send({0, 1, 0, 0, 0, 6, 1, 0x06, 0x00, 0x5D, 0, 1});
  server.faults().add({.kind = WireFaultKind::silence});
  peer.send({0, 2, 0, 0, 0, 6, 1, 0x06, 0x00, 0x5F, 0, 2});
  EXPECT_EQ(peer.ask({0, 3, 0, 0, 0, 6, 1, 0x03, 0x00, 0x5D, 0, 3}, 15),
            (Bytes{0, 3, 0, 0, 0, 9, 1, 0x03, 6, 0, 0, 0, 0, 0, 2}));
}

TEST_F(ModbusServer, ClosesAConnectionButTakesTheNext) {
  server.faults().add({.kind = WireFaultKind::close_connection});
  peer.send(read_output);
  EXPECT_TRUE(peer.closed());
  const TcpPeer again(server.port());
  EXPECT_EQ(again.ask(read_output, 13), output_answer);
}

TEST_F(ModbusServer, DiesAtItsTimeAndComesBackOnTheSamePort) {
  const std::uint16_t port = server.port();
  server.die_at(clock.now() + seconds(1));
  EXPECT_EQ(peer.ask(read_output, 13), output_answer);
  clock.advance(seconds(1));
  EXPECT_TRUE(peer.closed());
  EXPECT_FALSE(TcpPeer(port).connected());
  server.revive();
  EXPECT_EQ(server.port(), port);
  EXPECT_EQ(TcpPeer(port).ask(read_output, 13), output_answer);
}

TEST_F(ModbusServer, ADeadServerMeansAStoppedTableWhenTheWatchdogIsSet) {
  server.drive(1).write(0x007C, std::vector<std::uint16_t>{0, 1U << 4U});
  peer.send({0, 1, 0, 0, 0, 11, 1, 0x10, 0x13, 0x8A, 0, 2, 4, 0, 0, 0x01, 0xF4});  // 500 ms
  ASSERT_EQ(peer.receive(12).size(), 12U);
  server.drive(1).write(
      0x0058, std::vector<std::uint16_t>{0, 0, 0, 1, 0, 36000, 0, 9000, 0, 36000, 0, 36000, 0, 1000, 0, 1});
  clock.advance(milliseconds(400));
  EXPECT_TRUE(lab.truth().moving);
  server.die();
  clock.advance(milliseconds(110));
  for (int i = 0; i < 500 && server.drive(1).alarm() == 0; ++i)
    ::poll(nullptr, 0, 10);  // the server's thread ticks
  EXPECT_EQ(server.drive(1).alarm(), 0x85);
  clock.advance(seconds(1));
  EXPECT_FALSE(lab.truth().moving);
}

TEST_F(ModbusServer, RandomFaultsAreTheSameForTheSameSeed) {
  FaultPlan a;
  FaultPlan b;
  for (FaultPlan* plan : {&a, &b}) {
    plan->at_random(0.3, 42, {{.kind = WireFaultKind::silence}, {.kind = WireFaultKind::late}});
  }
  int faults = 0;
  for (int i = 0; i < 1000; ++i) {
    const auto kind = a.next().kind;
    EXPECT_EQ(kind, b.next().kind);
    faults += kind == WireFaultKind::none ? 0 : 1;
  }
  EXPECT_NEAR(faults, 300, 60);  // four standard deviations of 1000 draws
}

TEST_F(ModbusServer, APortThatIsTakenIsRefusedWithAReason) {
  SimModbusServerOptions options;
  options.port = server.port();
  EXPECT_THROW(SimModbusServer(lab, options), Error);
}

}  // namespace
}  // namespace eigenpose::sim
