/* The ring of rtbus/detail/seqlock.hpp on the machine of weak_machine.pml: a writer that may die once, between any two of its
 * stores, its successor, and a reader of the newest sample or of all in order. bus.pml has more samples, readers and
 * variants, on a model of memory without a window. */
#ifndef RING
#define RING 2
#endif
#ifndef SAMPLES
#define SAMPLES 3
#endif
#ifndef CALLS
#define CALLS 2
#endif
#define THREADS 2
#define LOCATIONS (1 + 3 * RING)
#define NEWEST 0
#define SEQUENCE(n) (1 + 3 * (((n) - 1) % RING))
#define WORD0(n) (SEQUENCE(n) + 1)
#define WORD1(n) (SEQUENCE(n) + 2)
#define TAG(n) (2 * (n) + generation)

/* Left out on purpose, one at a time. */
#ifdef WORDS_STORED_PLAIN
#define W2 PLAIN
#else
#define W2 RELEASE
#endif
#ifdef COMPLETION_STORED_PLAIN
#define W3 PLAIN
#else
#define W3 RELEASE
#endif
#ifdef NEWEST_STORED_PLAIN
#define W4 PLAIN
#else
#define W4 RELEASE
#endif
#ifdef NEWEST_LOADED_PLAIN
#define R1 PLAIN
#else
#define R1 ACQUIRE
#endif
#ifdef SEQUENCE_LOADED_PLAIN
#define R2 PLAIN
#else
#define R2 ACQUIRE
#endif
#ifdef WORDS_LOADED_PLAIN
#define R3 PLAIN
#else
#define R3 ACQUIRE
#endif

#include "weak_machine.pml"

byte final_newest = 0;                /* last sample whose W4 was issued */
byte meant[SAMPLES + 2];              /* tag of the sample under each number that was announced */

#define OR_DIE(statement) if :: statement :: generation == 0 -> goto died fi

proctype Writer() {
  byte me = 0;
  byte n = 1;
  byte generation = 0;
publish:
  if :: n > SAMPLES -> goto finished :: else fi;
  OR_DIE(store(SEQUENCE(n), 2 * n - 1, PLAIN));
  OR_DIE(store(WORD0(n), TAG(n), W2));
  OR_DIE(store(WORD1(n), TAG(n), W2));
  OR_DIE(store(SEQUENCE(n), 2 * n, W3));
  OR_DIE(atomic { store(NEWEST, n, W4); final_newest = n; meant[n] = TAG(n) });
  n++;
  goto publish;
died:
#ifndef TAKEOVER_WITHOUT_LOCK
  DRAINED;                            /* the lock of the file: what the dead one stored is there */
#endif
  atomic { generation = 1; n = memory[NEWEST] + 1 };
  goto publish;
finished:
  n = 0
}

proctype Reader() {
  byte me = 1;
  byte last = 0;
  byte n = 0;
  byte calls = 0;
  byte tries = 0;
  do
  :: calls == CALLS -> break
  :: calls < CALLS ->
    calls++;
    tries = 0;
    do
    :: tries == 3 -> break
    :: tries < 3 ->
      load(NEWEST, R1, 0);
      atomic { HAVE(0) -> n = VALUE(0); OURS.reg[0] = 0 };
#ifdef IN_ORDER
      atomic {
        if
        :: n > last && n - last > RING -> n = n - RING + 2  /* oldest_safe() of such a small ring */
        :: n > last && n - last <= RING -> n = last + 1
        :: else
        fi
      };
#endif
      if
      :: n <= last -> break
      :: n > last ->
        /* All at once: the words may be loaded before the sequence word has been compared. */
        load(SEQUENCE(n), R2, 0);
        load(WORD0(n), R3, 1);
        load(WORD1(n), R3, 2);
#ifndef NO_SECOND_CHECK
        load(SEQUENCE(n), PLAIN, 3);
#endif
        atomic { OURS.waits == 0 ->
#ifdef NO_SECOND_CHECK
          OURS.reg[3] = OURS.reg[0];
#endif
          if
          :: VALUE(0) == 2 * n && VALUE(3) == 2 * n ->
            assert(VALUE(1) == VALUE(2));    /* whole */
            assert(VALUE(1) / 2 == n);       /* the one that was asked for */
            assert(n <= final_newest && VALUE(1) == meant[n]);
#ifdef CLAIM_NOTHING_IS_READ
            assert(false);
#endif
            last = n;
            tries = 4
          :: else -> tries++
          fi;
          OURS.reg[0] = 0; OURS.reg[1] = 0; OURS.reg[2] = 0; OURS.reg[3] = 0; n = 0
        };
        if :: tries == 4 -> break :: else fi
      fi
    od
  od
}

init {
  atomic {
    run Core(0);
    run Core(1);
    run Writer();
    run Reader()
  }
}
