/* The doorbell of rtbus/detail/doorbell.hpp on the machine of weak_machine.pml: a writer, and SLEEPERS that wait for each of its
 * samples. A wake-up that is lost leaves a sleeper asleep with nobody to wake it: an invalid end state. Time-outs are left
 * out, so nothing else ends a sleep. */
#ifndef SAMPLES
#define SAMPLES 2
#endif
#ifndef SLEEPERS
#define SLEEPERS 1
#endif
#define THREADS (1 + SLEEPERS)
#define LOCATIONS 3
#define NEWEST 0
#define RINGS 1
#define ASLEEP 2
#define ALL_ORDERS 7   /* of a read-modify-write */

/* Left out on purpose, one at a time. */
#ifdef NEWEST_STORED_PLAIN
#define NEWEST_STORE PLAIN
#else
#define NEWEST_STORE RELEASE
#endif
#ifdef RING_RELAXED
#define RING_ORDER PLAIN
#else
#define RING_ORDER ALL_ORDERS
#endif
#ifdef LOOK_ACQUIRES_ONLY
#define LOOK ACQUIRE
#else
#define LOOK (ACQUIRE + SEQ_CST)
#endif
#ifdef SEEN_LOADED_PLAIN
#define SEEN PLAIN
#else
#define SEEN (ACQUIRE + SEQ_CST)
#endif

#include "weak_machine.pml"

bool asleep[THREADS];

proctype Writer() {
  byte me = 0;
  byte n = 0;
  byte i = 0;
  do
  :: n == SAMPLES -> break
  :: n < SAMPLES ->
    n++;
    store(NEWEST, n, NEWEST_STORE);
#ifndef NO_RING
    add(RINGS, 1, RING_ORDER, 1);
#endif
    load(ASLEEP, LOOK, 0);
    if
    :: atomic { HAVE(0) && VALUE(0) == 0 -> skip }
    :: atomic { HAVE(0) && VALUE(0) > 0 && DRAINED ->   /* FUTEX_WAKE: a barrier, then all that sleep */
         i = 1;
         do :: i < THREADS -> asleep[i] = false; i++ :: else -> break od;
         i = 0
       }
    fi
  od
}

proctype Sleeper(byte me) {
  byte last = 0;
  byte seen = 0;
  bool done = false;
  do
  :: last == SAMPLES -> break
  :: last < SAMPLES ->
    add(ASLEEP, 1, ALL_ORDERS, 2);
    done = false;
    do
    :: done -> break
    :: !done ->
      load(RINGS, SEEN, 0);
      load(NEWEST, ACQUIRE, 1);
      atomic { HAVE(0) && HAVE(1) ->
        if
        :: VALUE(1) > last -> last = VALUE(1); done = true
        :: else
        fi;
        seen = VALUE(0);
        OURS.reg[0] = 0; OURS.reg[1] = 0; OURS.reg[2] = 0
      };
      if
      :: done
      :: !done ->
        atomic { DRAINED -> asleep[me] = (memory[RINGS] == seen); seen = 0 };  /* FUTEX_WAIT */
        !asleep[me]
      fi
    od;
    add(ASLEEP, 255, ALL_ORDERS, 2)   /* -1 */
  od
#ifdef CLAIM_NOBODY_WAKES
  ; assert(false)
#endif
}

init {
  byte t = 0;
  atomic {
    do :: t < THREADS -> run Core(t); t++ :: else -> break od;
    run Writer();
    t = 1;
    do :: t < THREADS -> run Sleeper(t); t++ :: else -> break od;
    t = 0
  }
}
