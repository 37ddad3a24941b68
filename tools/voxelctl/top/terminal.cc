#include "tools/voxelctl/top/terminal.h"

#define NCURSES_NOMACROS  // keeps functions as functions: refresh(), erase(), timeout()
#include <curses.h>
#include <signal.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>

#include <clocale>
#include <cstdio>
#include <iterator>

namespace voxeld::voxelctl {
namespace {

constexpr int kEnding[] = {SIGHUP, SIGQUIT, SIGILL, SIGABRT, SIGBUS, SIGFPE, SIGSEGV};

termios g_before;
struct sigaction g_actions[std::size(kEnding)];
SCREEN* g_screen = nullptr;

// Runs in a signal handler, so it only calls async-signal-safe functions. Resets attributes and the
// keypad mode, shows the cursor, and leaves the alternate screen; terminals that do not know a
// sequence ignore it.
void Restore(int signal) {
  constexpr char kBack[] = "\x1b[0m\x1b[?1l\x1b>\x1b[?25h\x1b[?1049l\r";
  (void)!::write(STDOUT_FILENO, kBack, sizeof kBack - 1);
  ::tcsetattr(STDIN_FILENO, TCSANOW, &g_before);
  ::raise(signal);  // terminates the process now: SA_RESETHAND
}

short ColorOf(TopStyle style) {
  switch (style) {
    case TopStyle::kGood:
    case TopStyle::kChosen:
      return COLOR_GREEN;
    case TopStyle::kWarning:
      return COLOR_YELLOW;
    case TopStyle::kBad:
      return COLOR_RED;
    case TopStyle::kHeading:
      return COLOR_CYAN;
    default:
      return -1;
  }
}

attr_t AttributesOf(TopStyle style) {
  switch (style) {
    case TopStyle::kTitle:
    case TopStyle::kHeading:
    case TopStyle::kBad:
      return A_BOLD;
    case TopStyle::kChosen:
      return A_REVERSE;
    case TopStyle::kFaint:
      return A_DIM;
    default:
      return A_NORMAL;
  }
}

}  // namespace

std::unique_ptr<Terminal> Terminal::Open(bool colors) {
  if (::tcgetattr(STDIN_FILENO, &g_before) != 0) return nullptr;
  std::setlocale(LC_CTYPE, "");
  if (MB_CUR_MAX == 1) std::setlocale(LC_CTYPE, "C.UTF-8");
  g_screen = ::newterm(nullptr, stdout, stdin);
  if (g_screen == nullptr) return nullptr;
  const char* const move = ::tigetstr("cup");
  if (move == nullptr || move == reinterpret_cast<const char*>(-1)) {
    ::endwin();
    ::delscreen(g_screen);
    return nullptr;
  }
  for (size_t i = 0; i < std::size(kEnding); ++i) {
    struct sigaction action = {};
    action.sa_handler = Restore;
    action.sa_flags = static_cast<int>(SA_RESETHAND) | SA_NODEFER;
    ::sigaction(kEnding[i], &action, &g_actions[i]);
  }
  ::cbreak();
  // Ctrl-C is read as a key here: two of them in quick succession would otherwise terminate the
  // process before it could restore the terminal.
  termios keys;
  if (::tcgetattr(STDIN_FILENO, &keys) == 0) {
    keys.c_cc[VINTR] = _POSIX_VDISABLE;
    ::tcsetattr(STDIN_FILENO, TCSANOW, &keys);
    ::def_prog_mode();
  }
  ::noecho();
  ::nonl();
  ::keypad(stdscr, TRUE);
  ::set_escdelay(50);
  ::curs_set(0);
  if (colors && ::has_colors()) {
    ::start_color();
    ::use_default_colors();
    for (int style = 0; style <= static_cast<int>(TopStyle::kFaint); ++style) {
      ::init_pair(static_cast<short>(style + 1), ColorOf(static_cast<TopStyle>(style)), -1);
    }
  }
  return std::unique_ptr<Terminal>(new Terminal());
}

Terminal::~Terminal() {
  ::endwin();
  ::delscreen(g_screen);
  g_screen = nullptr;
  for (size_t i = 0; i < std::size(kEnding); ++i) ::sigaction(kEnding[i], &g_actions[i], nullptr);
  ::tcsetattr(STDIN_FILENO, TCSANOW, &g_before);
}

int Terminal::width() const { return COLS; }
int Terminal::height() const { return LINES; }

void Terminal::Show(const std::vector<TopLine>& lines) {
  ::erase();
  for (size_t row = 0; row < lines.size(); ++row) {
    const TopLine& line = lines[row];
    attr_t attributes = AttributesOf(line.style);
    if (::has_colors()) {
      attributes |= static_cast<attr_t>(COLOR_PAIR(static_cast<int>(line.style) + 1));
    }
    ::attrset(static_cast<int>(attributes));
    ::mvaddstr(static_cast<int>(row), 0, line.text.c_str());
  }
  ::attrset(A_NORMAL);
  ::refresh();
}

TopKey Terminal::Wait(int milliseconds) {
  ::timeout(milliseconds);
  switch (::getch()) {
    case 'q':
    case 'Q':
    case 3:   // Ctrl-C
    case 4:   // Ctrl-D
    case 27:  // Escape
      return TopKey::kQuit;
    case 'p':
    case 'P':
    case ' ':
      return TopKey::kPause;
    case '\t':
    case KEY_DOWN:
    case KEY_RIGHT:
      return TopKey::kNext;
    case KEY_BTAB:
    case KEY_UP:
    case KEY_LEFT:
      return TopKey::kPrevious;
    case KEY_RESIZE:
      return TopKey::kResize;
    default:
      return TopKey::kNone;
  }
}

}  // namespace voxeld::voxelctl
