/* The cells that hand an object from one thread to another, on the machine of weak_machine.pml:
 *   -DSUBSCRIPTION  rtbus/subscription.hpp: readers to the realtime thread and back
 *   -DPUBLICATION   rtbus/publication.hpp: writers likewise, two in use during a hand-over
 *   -DLATEST_CELL   haptic_node/latest_cell.hpp: the newest value, by three slots
 * Thread 0 does the housekeeping (LATEST_CELL: writes), thread 1 is the realtime one (reads). An object's content is 0 while
 * it is not there; the realtime thread must find each object that it uses whole, and touch none that was deleted. */
#ifndef ROUNDS
#define ROUNDS 4
#endif
#ifndef USES
#define USES 4
#endif
#define THREADS 2

/* Left out on purpose, one at a time. */
#ifdef OFFER_RELAXED
#define OFFER PLAIN
#else
#define OFFER RELEASE
#endif
#ifdef TAKE_RELAXED
#define TAKE PLAIN
#else
#define TAKE ACQUIRE
#endif
#ifdef RETURN_RELAXED
#define RETURN PLAIN
#else
#define RETURN RELEASE
#endif
#ifdef COLLECT_RELAXED
#define COLLECT PLAIN
#else
#define COLLECT ACQUIRE
#endif

#ifdef LATEST_CELL
#define LOCATIONS 7
#define MIDDLE 0
#define WORD0(slot) (1 + 2 * (slot))
#define WORD1(slot) (2 + 2 * (slot))
#define FRESH 4
#else
#define OBJECTS 3
#define INCOMING 0
#define RETIRED 1
#define LET_GO 2
#define CONTENT(object) (2 + (object))   /* objects from 1 on; 0 is none */
#define LOCATIONS (3 + OBJECTS)
#define MADE 1
#define USED 2
/* What the realtime thread still had to store into a deleted object. */
#define ON_STORE(thread, location, stored) assert(thread == 0 || location <= LET_GO || memory[location] != 0)
#endif

#include "weak_machine.pml"

#ifdef LATEST_CELL
proctype Housekeeping() {
  byte me = 0;
  byte mine = 0;
  byte n = 1;
  do
  :: n > ROUNDS -> break
  :: n <= ROUNDS ->
    store(WORD0(mine), n, PLAIN);
    store(WORD1(mine), n, PLAIN);
    exchange(MIDDLE, (mine | FRESH), (TAKE + OFFER), 0);
    atomic { HAVE(0) -> mine = (VALUE(0) & 3); OURS.reg[0] = 0; n++ }
  od
}

proctype Realtime() {
  byte me = 1;
  byte theirs = 1;
  byte uses = 0;
  byte last = 0;
  bool loads = false;
  do
  :: uses == USES -> break
  :: uses < USES ->
    uses++;
    load(MIDDLE, PLAIN, 0);
    HAVE(0);
    if
    :: (VALUE(0) & FRESH) == 0
    :: (VALUE(0) & FRESH) != 0 ->
      exchange(MIDDLE, theirs, (COLLECT + RETURN), 0);
      atomic { HAVE(0) -> theirs = (VALUE(0) & 3); OURS.reg[0] = 0 };
      /* What was taken before: its copy may have been made as late as that exchange allows. */
      if
      :: loads -> atomic { HAVE(1) && HAVE(2) -> assert(VALUE(1) == VALUE(2) && VALUE(1) > last); last = VALUE(1) }
      :: else
      fi;
      load(WORD0(theirs), PLAIN, 1);
      load(WORD1(theirs), PLAIN, 2);
      loads = true
    fi
  od;
  if
  :: loads -> atomic { HAVE(1) && HAVE(2) -> assert(VALUE(1) == VALUE(2) && VALUE(1) > last); last = VALUE(1) }
  :: else
  fi
#ifdef CLAIM_NOTHING_ARRIVES
  ; assert(last == 0)
#endif
}
#else

bool here[OBJECTS + 1];   /* the allocator's */
inline make(object) {
  atomic {
    object = 1;
    do :: object <= OBJECTS && here[object] -> object++ :: else -> break od;
    assert(object <= OBJECTS);
    here[object] = true
  };
  store(CONTENT(object), MADE, PLAIN)
}
inline delete(object) {
  store(CONTENT(object), 0, PLAIN);
  here[object] = false
}
/* The realtime thread reads an object, and writes into it. */
inline use(object) {
  load(CONTENT(object), PLAIN, 1);
  atomic { HAVE(1) -> assert(VALUE(1) != 0); OURS.reg[1] = 0 };
  store(CONTENT(object), USED, PLAIN)
}

#ifdef SUBSCRIPTION
proctype Housekeeping() {
  byte me = 0;
  byte rounds = 0;
  byte fresh = 0;
  byte old = 0;
  do
  :: rounds == ROUNDS -> break
  :: rounds < ROUNDS ->
    rounds++;
    exchange(RETIRED, 0, COLLECT, 0);
    atomic { HAVE(0) -> old = VALUE(0); OURS.reg[0] = 0 };
    if :: old != 0 -> delete(old) :: else fi;
    if
    :: skip                                             /* the name leads where it led */
    :: here[1] + here[2] + here[3] < 3 ->
      make(fresh);
      exchange(INCOMING, fresh, (ACQUIRE + OFFER), 0);
      atomic { HAVE(0) -> old = VALUE(0); OURS.reg[0] = 0 };
      if :: old != 0 -> delete(old) :: else fi          /* withdrawn */
    fi;
    fresh = 0;
    old = 0
  od
}

proctype Realtime() {
  byte me = 1;
  byte current = 0;
  byte fresh = 0;
  byte uses = 0;
  do
  :: uses == USES -> break
  :: uses < USES ->
    uses++;
    load(INCOMING, PLAIN, 0);
    HAVE(0);
    if
    :: VALUE(0) == 0
    :: VALUE(0) != 0 ->
      load(RETIRED, PLAIN, 0);
      HAVE(0);
      if
      :: VALUE(0) != 0
      :: VALUE(0) == 0 ->
        exchange(INCOMING, 0, TAKE, 0);
        atomic { HAVE(0) -> fresh = VALUE(0); OURS.reg[0] = 0 };
        if
        :: fresh == 0                                   /* withdrawn in between */
        :: fresh != 0 ->
          store(RETIRED, current, RETURN);
          current = fresh;
          fresh = 0
        fi
      fi
    fi;
    if :: current != 0 -> use(current) :: else fi
  od
#ifdef CLAIM_NOTHING_ARRIVES
  ; assert(current == 0)
#endif
}
#else

/* Ghost: LET_GO holds the number of its hand-over, where the code has a flag. */
byte hand_overs = 0;
proctype Housekeeping() {
  byte me = 0;
  byte rounds = 0;
  byte newest = 1;
  byte outgoing = 0;
  byte fresh = 0;
  byte old = 0;
  do
  :: rounds == ROUNDS -> break
  :: rounds < ROUNDS ->
    rounds++;
    if
    :: outgoing != 0 ->
      load(INCOMING, ACQUIRE, 0);
      HAVE(0);
      if
      :: VALUE(0) != 0 ->                                 /* not taken; it may have been deleted too */
        if
        :: skip
        :: exchange(INCOMING, 0, (ACQUIRE + RELEASE), 0);
          atomic { HAVE(0) -> old = VALUE(0); OURS.reg[0] = 0 };
          if
          :: old != 0 -> delete(old); newest = outgoing; outgoing = 0
          :: old == 0
          fi
        fi
      :: VALUE(0) == 0 ->
        if
        :: skip                                           /* kHandOver_ns is not over */
        :: store(LET_GO, hand_overs, PLAIN);
          exchange(RETIRED, 0, COLLECT, 0);
          atomic { HAVE(0) -> old = VALUE(0); OURS.reg[0] = 0 };
          if
          :: old != 0 -> assert(old == outgoing); delete(old); outgoing = 0
          :: old == 0
          fi
        fi
      fi
    :: outgoing == 0 ->
      if
      :: skip
      :: make(fresh);
        outgoing = newest;
        newest = fresh;
        store(LET_GO, 0, PLAIN);
        hand_overs++;
        store(INCOMING, fresh, OFFER)
      fi
    fi;
    fresh = 0;
    old = 0
  od
}

proctype Realtime() {
  byte me = 1;
  byte current = 1;
  byte former = 0;
  byte fresh = 0;
  byte uses = 0;
  byte taken = 0;
  do
  :: uses == USES -> break
  :: uses < USES ->
    uses++;
    load(INCOMING, PLAIN, 0);
    HAVE(0);
    if
    :: VALUE(0) == 0
    :: VALUE(0) != 0 ->
      exchange(INCOMING, 0, (TAKE + RELEASE), 0);
      atomic { HAVE(0) -> fresh = VALUE(0); OURS.reg[0] = 0 };
      if
      :: fresh == 0
      :: fresh != 0 ->
        atomic { assert(former == 0); former = current; current = fresh; fresh = 0; taken = hand_overs }
      fi
    fi;
    use(current);
    if
    :: former == 0
    :: former != 0 ->
      use(former);
      load(LET_GO, PLAIN, 0);
      atomic { HAVE(0) -> fresh = VALUE(0); OURS.reg[0] = 0 };
      if
      :: fresh == 0
      :: fresh != 0 ->
        assert(fresh == taken);                           /* not what the last hand-over left */
        store(RETIRED, former, RETURN);
        former = 0
      fi;
      fresh = 0
    fi
  od
#ifdef CLAIM_NOTHING_ARRIVES
  ; assert(current == 1)
#endif
}
#endif
#endif

init {
  atomic {
#ifdef LATEST_CELL
    memory[MIDDLE] = 2;
#endif
#ifdef PUBLICATION
    here[1] = true;
    memory[CONTENT(1)] = MADE;
#endif
    run Core(0);
    run Core(1);
    run Housekeeping();
    run Realtime()
  }
}
