"""Words for pieces in the languages of pattern rooms, by kind: what ``kinds.py`` looks for in names.

Names come here in lower case without accents ("Rückenteil" as "ruckenteil"), so words are written so. Short words stand
alone (``\\b``), long ones also within a compound: "aermel" in "Oberaermel". Programs that do not know Unicode write
umlauts as two letters.
"""

from __future__ import annotations

# The more telling kinds first: a "sleeve cuff" is a cuff.
WORDS = (
    (
        "none",
        r"facing|(?<!neck )(?<!neckline )\bbinding|\bbias\b|paspel|schragband|\blini\b|\blng\b"
        r"|interlin|interfac|fusing|fusible|\bfuse\b|lining|label|pocket|\bpouch|flap|welt|belt\b|loop|plac?ket|\bplkt\b"
        r"|placard|\bfly\b|\btasche|tasche\b|taschen|beleg|besatz|besaetze|futter|einlage|etikett|schlaufe|\bpatten?\b"
        r"|leiste|schlitz|\bzak\b|zakken|voering|\bpoche|parement|doublure|enforme|entoilage|rabat|passant"
        r"|biais|\bpattes?\b|bolsi?l?lo|\bbolso|\bvista\b|\bcarteras?\b|\bpasador(es)?\b|forro|entretela|tapeta|trabilla|bragueta|carcela"
        r"|\bvies\b|solapa de bols|tasca|fodera|\bpassante|paramontura|ripiego|\bpatta\b|taschino|sbieco"
        r"|\w +elastics? *$|elastic (guide|template|tape)|^ *elasti(co|que)s? |gummi(band)?\b"  # no band of such cloth
        r"|\bpatch(es)?\b|draw ?(string|cord)"
        r"|button ?(stand|band)|zip(per)? ?(guard|shield)|\bfcg\b"
        r"|kordel\b|tunnelzug|cordoncillo|抽绳|补丁"
        r"|kiesze|podszew|obloz|kapsa|podsivk|karman|podklad|\bобтачк|подборт|підборт|кишен|карман|подклад|клапан|шлевк|шлівк|підклад|дублер|\bcep\b"
        r"|cebi|astar|\bpervaz|\blomme|\bficka|tasku|vuori|tuki\b|lisake|kou ?dai|dou ?bu|li ?bu|gua ?mian|袋"
        r"|里布|里料|贴边|挂面|衬|门襟|门筒|裤耳|ポケット|見返し|裏地|주머니|안감|zseb|belebujt|\bbeles|buzunar|captuseal",
    ),
    (
        "strap",
        r"(?<!sleeve )straps?\b|\bstrp\b|bretell|\btra(e|)ger\b|spagh?ettitr|\btirantes?\b|\bspallin[ae]\b|\balcas?\b"
        r"|ramiacz|бретел|\baski\b|axelband|schouderband|\bbandjes?\b"
        r"|肩带|肩帶|吊带|吊帶|肩紐|肩ひも|ストラップ|어깨 ?끈|스트랩",
    ),
    (
        "hem_band",
        r"(?<!sleeve )(?<!arm )(hem|bottom|btm)[ _-]*(band|rib)|rib[ _-]*(hem|bottom|btm)"
        r"|\bunder ?band|unterbrustband|\bbra ?band\b"
        r"|saumb(ue|u)ndchen|b(ue|u)ndchen (saum|unten)"
        r"|saumbund|bord[ _-]*cote[ _-]*(bas|ourlet)|(bajo|cintura|dobladillo) (de )?(canale|rib)"
        r"|fondo costina|xia ?bai|下摆|下脚罗纹|裾リブ",
    ),
    (
        "cuff",
        r"cuff|\bcff\b|(sleeve|\barm(hole|scye)?|wrist)[ _-]*(hem[ _-]*)?(band|rib)\b|armlochb(ue|u)ndchen"
        r"|\bb(ue|u)ndchen\b|a(e|)rmelb(ue|u)ndchen|manschette|manchet|(?<!hals)boord\b|poignet|\bpun(h)?o"
        r"|fondo gamba|(jiao|ku) ?kou|脚口|裤口|\bbas de (manche|jambe)"
        r"|polsin|\bpolso|mankiet|manzet|манжет|\bmanset|linning|\bmudd\b|kalvosin|xiu ?kou|\bke ?fu|袖口"
        r"|克夫|袖头|袖克|カフス|커프스|소매단|mandzsetta|kezelo\b|\bmanseta\b",
    ),
    (
        "hood",
        r"\bhood|hood\b|\bhd\b|kapuze|capuch|cappuccio|capuz|kaptur|kapuc|kapyuson|kapuson|kapisjong|hette"
        r"|hatta\b|huppu|капюшон|\bmao ?(zi|pian)?\b|\bmaozi|帽|フード|후드|csuklya|\bgluga",
    ),
    (
        "waistband",
        r"wai?st[ _-]*(band|bnd|rib)|\bwst ?bn?d\b|\bw ?b\b|hosenbund|rockbund|\bbund\b|formbund|tailleband|ceinture"
        r"|cintur|pretina|\bcos\b|pasek|pas do spodni|pasove|пояс|\bpoyas|\bkemer|linning(en)? i livet"
        r"|midjelinning|vyotaro|yao ?tou|腰头|腰頭|腰带|ベルト|허리|derekpant|ovpant|\bbetelie",
    ),
    (
        "collar",
        r"collar|\bcoll?\b|\bcl?lr\b|\bstand\b|neck[ _-]*(band|rib|bind|line|trim)|rib[ _-]*neck|kragen|\bsteg\b"
        r"|halsb(ue|u)ndchen|halsb|kraag|halsboord|\bcol\b|pied de col|encolure|bord[ _-]*cote|cuello|\bgola"
        r"|collarin|colletto|\bcollo\b"
        r"|listino|kolnierz|limec|vorotnik|воротник|\bбейк|комір|стойка|\byaka\b|\bkrage|\bkrave|kaulus"
        r"|\b(shang|xia|ni|fan)? ?ling(zi|pian|wei|mian|di)?\b|领|領|\beri\b|衿|칼라|카라|넥 ?밴드"
        r"|\bgaller|nyakpant|\bguler|\bplisa dekolt|halsmudd|pruseku|vystrihu",
    ),
    (
        "yoke",
        r"yoke|\byk\b|\briser\b|passe\b|\w+pas\b|\bsattel|schulterpasse|empiecement|canesu|\bpala\b|sprone|carre\b|karczek|sedlo"
        r"|koketk|кокетк|\broba\b|\bbesparing|kaarroke|yu ?ke|guo ?jian|育克|过肩|過肩|ヨーク|요크",
    ),
    ("godet", r"godet"),
    (
        "gusset",
        r"gusset|zwickel|soufflet|tassello|\bnesga|fuelle|klin\b|ластовиц|裆布|マチ",
    ),
    (
        "sleeve",
        r"sleeve|\b[lr]?slv|\b[lr]?sl\b|(a|ae)rmel|mouw|manche|manga|manica|rekaw|rukav|рукав|\bkol\b|\bkolu\b|\barm\b"
        r"|\baerme|\bhiha|\bxiu|(da|xiao|qian|hou) ?xiu|\btay\b|袖|スリーブ|소매|\bsode|\bujja?\b|\bmaneca",
    ),
    (
        "leg",
        r"\b[lr]?leg|pants?\b|\btrs\b|\bpnt\b|trouser|\btights\b|\bbeine?\b|jean|hosen?\b|hosen|\bhose|shorts?\b|legging|pantal|broek|jambe|pernera"
        r"|gamba|calca\b|calcas|nogawk|\bspodnie?\b|kalhot|nohavic|bryuk|brjuk|брюк|полов\w* брюк|pantolon"
        r"|\bpaca\b|byxor|buks|housut|lahje|\bku(zi|pian)?\b|(qian|hou) ?ku|\bchang ?ku|裤|褲|パンツ|바지|\bnadrag",
    ),
    (
        "skirt",
        r"skirt|\bskr?t\b|peplum|scho(e|)sschen|\bgores?\b|rock\b|rockbahn|\bbahn(en)?\b|\brock|\brok\b|jupe|falda|\bsaia|gonna|spodnic|sukne|yubk|юбк|\betek|kjol|nederdel"
        r"|hame\b|qun|裙|スカート|치마|szoknya|\bfusta",
    ),
    (
        "front",
        r"front|\bftorso|\bfrn?t?\b|\bf\b|vord|\bvorn|\bvt\b|voorpand|\bvoor|devant|\bavant|delanter|\bfrente|davanti"
        r"|\bdavant|przod|predni|\bpered|полочк|пілочк|перед|\bpolochk|\bon (beden|parca|govde|pantolon|etek|ust)"
        r"|framsty|framst|\bfram\b|forstyk|etukap|\betu|\bqian|前|\bmae|앞|than truoc|\belejer?|\bfata\b",
    ),
    (
        "back",
        r"back|\bbtorso|\bbc?k\b|\bb\b|r(u|ue)ck|\brt\b|\bdos\b|espald|traser|\bcostas\b|dietro|\bretro|hint(er|en)"
        r"|\bht\b|rear|arriere|achter|\btyl|zadni|spink|спинк|зад|\bzad|\barka|baksty|bakst|\bbak\b|bagstyk"
        r"|takakap|\btaka|\bhou(?!se|r)|后|後|\bushiro|뒤|than sau|\bhat(a|ulja|so|resz)\b|\bspate\b",
    ),
    # a collar by the name of the garment, which its front and sleeves may have, too
    ("collar", r"(turtle|roll|polo|mock|funnel|cowl)[ _-]*neck\b|cuello (alto|vuelto)|\bcol roule|高领"),
)
# Words for a band of rib (plain "rib" may be the cloth of a sleeve), and for where it goes, which tells its kind
RIB = r"ribana|lastigi|b(ue|u)ndchen|bord[ _-]*cotes?\b|\bcostin|\bcanale\b|\bbord(o|ino)\b|罗纹"
RIBBED = (
    ("collar", r"neck|hals|ausschnitt|encolure|\bcol\b|cuello|escote|\bcollo|colletto|scollo|\byaka|dekolt|领|領|衿"),
    (
        "cuff",
        r"sleeve|wrist|cuff|ankle|\barm|a(e|)rmel|emmanchure|\bsisa|manche|poignet|manga|puno|manica|polso|\bkol\b|rekaw|袖",
    ),
    ("cuff", r"\bleg\b|\bbein|jambe|pernera|pierna|gamba|\bpaca\b|nogawk|裤口|脚口|裤脚"),
    ("waistband", r"waist|\bbund\b|taille|cintura|\bvita\b|\bbel\b|\bpas\b|腰"),
    ("hem_band", r"\bhem\b|bottom|\bbtm\b|saum|\bbas\b|ourlet|\bbajo|fondo|\betek\b|\bdol\b|下摆"),
)
# A strip gathered to what it is sewn to: to the hem, where no word of RIBBED says otherwise
RUFFLE = (
    r"ruffles?\b|\bfrills?\b|flounce|\bvolante?s?\b|r(u|ue)sche|\bbalz[ae]\b|\bfirfir|falbal|\bbabado|falban|волан|оборк"
    r"|荷叶边|フリル|프릴"
)
# One of the strips of a skirt that are gathered one below another
TIER = r"\btier(s|ed)?\b|\bstufen?\b|\bstufenrock|\betages?\b|\bescalon(es)?\b|ярус|ティア|티어"
# The upper piece of dungarees or a pinafore, where no word says that it is a front or back
BIB_WORDS = r"\bbib\b|\blatz\b|latz\b|\bbavette\b|\bpeto\b|pettorina|\bpeitilho|\bslabbetje|胸当て|护胸"
# What a piece is cut for, and is not: "front without pocket"
BESIDE = (
    r"\b(with(out)?|no|w o|mit|ohne|avec|sans|con|sin|senza|com|sem) (a )?(pocket|tasche|poche|bolsillo|tasca|bolso)\w*"
)
INNER_CLOTH = (
    r"lining|fus(e|ing|ible)|interlin|interfac|futter|einlage|doublure|thermocoll|entretela|forro"
    r"|fodera|adesiv|podszew|подклад|дублер|astar|里布|里料|衬"
)
# Pieces beside the middle ones of a front or back, and under sleeves of sleeves of two pieces
SIDE_PANEL_WORDS = (
    r"\bside|princess|seitenteil|seitl|\bseite|zijpand|\bzij|cote\b|\bflanc|costad|lateral|fianc"
    r"|fianchetto|boczek|\bbok\b|bocni|бочок|боков|\byan\b|\bsid|sivukap|sivupal|\bce ?(pian|qian|hou)?\b|侧|側"
    r"|脇|옆"
)
# The part of a collar that is sewn to the neckline, below the fall
STAND = (
    r"stand|\bsteg\b|pied|\bbase\b|collarbase|collar ?band|\bpie\b|tirilla|listino|fascetta|stojk|stoyk"
    r"|стойк|stojak|stojka|\bayak|(di|xia) ?ling|ling ?zuo|领座|領座|底领|下领|台衿|台襟"
)
UNDER = (
    r"under|\bbottom\b|\blower\b|unter|\bonder|dessous|de abajo|menor|\bsotto|inferior|spodni|нижн|\balt\b|\bala ?osa"
    r"|\balis|\bxiao ?xiu|小袖|内袖|內袖|下袖|안"
)
# Which of several fronts, backs or skirts is above the others, between them, or below them
ABOVE = (
    r"upper|\btop\b|\bober|\boben\b|\bhaut\b|superior|\bboven|\bsopra\b|\bgor(a|n[aey])\b|\bhorni\b|верх|\bust\b|\bovre\b"
    r"|上|위"
)
BETWEEN = r"\bmid(dle)?\b|midriff|中间|中間|중간"
BELOW = (
    r"lower|bottom|\bbtm\b|\bunte(n|r(es|er|teil)?)\b|\bbas\b|inferior|\bonder|\bsotto\b|\bdol(n[aey])?\b|\bspodni|\bniz|низ|нижн"
    r"|\balt\b|\bnedre\b|peplum|\bhem\b|下|아래"
)
# A layer over or under another piece of its name
LAYER_WORDS = (
    r"\binner\b|\binnen|\binterieure?\b|\binterior|\bintern[oae]\b|\bbinnen|внутр|内层|內層|里层|裡層|内裙|衬裙|안쪽"
    r"|\b(under|over) ?(lay(er)?|skirt|dress)s?\b|\blayer\b|petticoat|\bslip\b"
    r"|\bunterrock|\bunterlage|\bjupon|\benagua|\bsous jupe|\bsottogonna|\banagua"
)
LEFT_WORDS = (
    r"\bleft|\blh\b|\bl(?=(slv?|leg|cuff|sleeve|fro?nt|back|bk|frt)\b)|\bl\b|\blinke?[rs]?\b|\bgauche|izquierd|\bizq\b|esquerd|sinistr|\bsx\b"
    r"|\blew[aey]\b|\blev[aey]\b|лев|\bsol\b|\bvanst|\bvenst|\bvasen|\bzuo|左|왼"
)
RIGHT_WORDS = (
    r"\bright|\brh\b|\br(?=(slv?|leg|cuff|sleeve|fro?nt|back|bk|frt)\b)|\br\b|rechte?[rs]?\b|rechts|\bdroite?\b|derech|direit|destr|\bdx\b|\bpraw[aey]\b"
    r"|\bprav[aey]\b|прав|\bsag\b|\bhoger|\bhojre|\boikea|\byou ?(qian|hou|xiu)|右|오른"
)
